// SPDX-License-Identifier: MIT
#include "command.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "files.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/validate_input.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/suggestion.h"
#include "skeletex/model/error.h"

namespace skeletex::cli {

void add_device_option(CLI::App& command, std::string& selector) {
  command
      .add_option("--device", selector,
                  "OpenCL device: its number in `skeletex devices`, a part of its name, cpu or gpu (default: "
                  "SKELETEX_DEVICE, else the first GPU)")
      ->type_name("DEVICE");
}

void add_json_option(CLI::App& command, std::string& target) {
  declare_text_output(
      command, command.add_option("--json", target, "write the results as JSON to this file; - for standard output"))
      ->type_name("FILE|-");
}

void take_one_of(CLI::Option& option, const std::vector<std::string>& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : "|") + word;
  option.type_name(list)->check(
      [words, list](const std::string& given) -> std::string {
        if (std::find(words.begin(), words.end(), given) != words.end()) return {};
        return fmt::format("\"{}\" is not one of {}{}", given, list, did_you_mean(given, words));
      },
      "");
}

void write_json(const std::string& target, const Json& json) {
  if (target.empty()) return;
  const std::string text = json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
  if (target == "-")
    std::fwrite(text.data(), 1, text.size(), stdout);
  else
    write_text_atomically(target, text);
}

void print(const std::string& json_target, const std::string& text) {
  if (json_target == "-") return;
  std::fwrite(text.data(), 1, text.size(), stdout);
  std::fflush(stdout);  // long runs are watched through pipes and files
}

void warn(const std::string& text) { spdlog::warn("{}", text); }

void check_output(const std::filesystem::path& path) {
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored))
    throw IoError(fmt::format("{}: there is no folder {}; make it first", path.string(), folder.string()));
  if (std::filesystem::is_directory(path, ignored))
    throw IoError(fmt::format("{} is a folder; name a file in it", path.string()));
  if (::access(folder.c_str(), W_OK) != 0)
    throw IoError(fmt::format("{}: the folder {} is not writable", path.string(), folder.string()));
}

TriangleMesh load_mesh(const std::filesystem::path& path) {
  MeshFile file = read_mesh(path);
  if (file.triangles != file.faces_in_file)
    spdlog::info("{}: {} polygons became {} triangles", path.string(), file.faces_in_file, file.triangles);
  if (file.merged_vertices > 0)
    spdlog::info("{}: {} of {} vertices lay on others and were welded", path.string(), file.merged_vertices,
                 file.vertices_in_file);
  if (file.ends_in_face && !measure_manifold(file.mesh).is_closed_manifold())
    warn(fmt::format("{}: the file ends within a line, and its surface is not closed; it may have been cut on its way",
                     path.string()));
  return std::move(file.mesh);
}

void require_valid(TriangleMesh& mesh, const Skeleton& skeleton, std::optional<TriangleTree>* tree) {
  const std::vector<Finding> findings = validate_before_segmentation(mesh, skeleton, tree);
  int errors = 0;
  for (const Finding& finding : findings) {
    const std::string text = finding.message + (finding.remedy.empty() ? "" : "\n  remedy: " + finding.remedy);
    switch (finding.severity) {
      case Severity::kNote: spdlog::info("{}", text); break;
      case Severity::kWarning: spdlog::warn("{}", text); break;
      case Severity::kError: ++errors; spdlog::error("{}", text);
    }
  }
  if (errors > 0) throw CLI::RuntimeError(kExitBad);
}

Json profile_json(ClContext& context) {
  Json list = Json::array();
  for (const ClProfileEntry& entry : context.profile())
    list.push_back({{"kernel", entry.kernel}, {"launches", entry.launches}, {"ms", entry.milliseconds}});
  return list;
}

}  // namespace skeletex::cli
