// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "skeletex/io/image_file.h"
#include "skeletex/io/mesh/text_reader.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/read_file.h"

namespace skeletex {
namespace {

namespace fs = std::filesystem;

/// Paths of files come from any system.
fs::path relative_to(const fs::path& mesh, std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  return mesh.parent_path() / name;
}

/// The file of "map_Kd -s 1 1 1 -clamp on name with spaces.png": what is left after the options.
std::string_view file_of_map(std::string_view line, const std::vector<std::string_view>& words) {
  std::size_t at = 1;
  while (at < words.size() && words[at].starts_with('-') && words[at].size() > 1) {
    const std::string option = lower_case(words[at++]);
    if (option == "-o" || option == "-s" || option == "-t") {
      for (int i = 0; i < 3 && at < words.size() && number_from(words[at]); ++i) ++at;
    } else {
      at += option == "-mm" ? 2 : 1;
    }
  }
  if (at >= words.size()) return {};
  return line.substr(static_cast<std::size_t>(words[at].data() - line.data()));
}

void read_material_file(const fs::path& path, const fs::path& mesh, std::vector<Material>& materials) {
  const std::string bytes = read_file(path), where = path.string();
  TextReader text(bytes, where);
  Material ignored, *material = &ignored;  // of materials that no face uses
  const auto colour = [&](const std::vector<std::string_view>& words, int i) {
    return linear_from_srgb(static_cast<float>(text.coordinate(words[1 + static_cast<std::size_t>(i)])));
  };
  while (!text.at_end()) {
    const std::string_view line = text.next_line();
    const std::vector<std::string_view>& words = text.split(line, '#');
    if (words.size() < 2) continue;
    const auto rest = [&](std::string_view from) {
      std::string name(from);
      while (!name.empty() && (name.back() == ' ' || name.back() == '\t')) name.pop_back();
      return name;
    };
    if (words[0] == "newmtl") {
      const std::string name = rest(line.substr(static_cast<std::size_t>(words[1].data() - line.data())));
      const auto found =
          std::find_if(materials.begin(), materials.end(), [&](const Material& m) { return m.name == name; });
      material = found == materials.end() ? &ignored : &*found;
    } else if (words[0] == "Kd" && words.size() >= 4 && number_from(words[1])) {
      for (int i = 0; i < 3; ++i) material->base[i] = colour(words, i);
    } else if (words[0] == "map_Kd") {
      if (const std::string name = rest(file_of_map(line, words)); !name.empty())
        material->image_file = relative_to(mesh, name);
    }
  }
  // Programs write any colour beside a picture, black too; what is meant is the picture.
  for (Material& m : materials)
    if (!m.image_file.empty()) m.base = Colour::Ones();
}

}  // namespace

std::vector<std::string> read_materials(const fs::path& path, MeshFile& file) {
  std::vector<std::string> missing;
  std::error_code ignored;
  std::vector<Material>& materials = file.attributes.materials;
  for (const std::string& name : file.material_files) {
    const fs::path material_file = relative_to(path, name);
    if (fs::is_regular_file(material_file, ignored))
      read_material_file(material_file, path, materials);
    else
      missing.push_back(
          fmt::format("{}: its materials are in {}, which is missing", path.string(), material_file.string()));
  }
  for (Material& material : materials) {
    if (material.image_file.empty() || !material.image.empty()) continue;
    if (fs::is_regular_file(material.image_file, ignored))
      material.image = read_image(material.image_file);
    else
      missing.push_back(fmt::format("{}: the picture {} of material \"{}\" is missing", path.string(),
                                    material.image_file.string(), material.name));
  }
  return missing;
}

}  // namespace skeletex
