// SPDX-License-Identifier: MIT
#include "command.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <map>

#include "files.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/validate_input.h"
#include "skeletex/io/atomic_file.h"
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

namespace {

std::map<const CLI::Option*, std::vector<std::string>>& words_of_options() {
  static std::map<const CLI::Option*, std::vector<std::string>> all;
  return all;
}

}  // namespace

std::vector<std::string> words_of(const CLI::Option& option) {
  const auto found = words_of_options().find(&option);
  return found == words_of_options().end() ? std::vector<std::string>() : found->second;
}

void take_one_of(CLI::Option& option, const std::vector<std::string>& words) {
  words_of_options()[&option] = words;
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : "|") + word;
  option.type_name(list)->check(
      [words, list](const std::string& given) -> std::string {
        if (std::find(words.begin(), words.end(), given) != words.end()) return {};
        return fmt::format("\"{}\" is not one of {}{}", given, list, did_you_mean(given, words));
      },
      "");
}

std::vector<std::string> command_names(const CLI::App& program) {
  std::vector<std::string> names;
  for (const CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  return names;
}

void check_command(const CLI::App& program, const std::string& name) {
  const std::vector<std::string> names = command_names(program);
  if (std::find(names.begin(), names.end(), name) == names.end())
    throw CLI::ExtrasError(fmt::format("unknown command {}{}", name, did_you_mean(name, names)),
                           CLI::ExitCodes::ExtrasError);
}

void take_command(CLI::Option& option, const CLI::App& program) {
  words_of_options()[&option] = command_names(program);
  option.check(
      [&program](const std::string& given) {
        check_command(program, given);
        return std::string();
      },
      "");
}

namespace {

void write_to_terminal(const std::string& text) { std::fwrite(text.data(), 1, text.size(), stdout); }

/// JSON in which the control characters that its writer leaves, U+007F to U+009F, are escaped too.
std::string json_printable(const std::string& json) {
  std::string result;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const auto byte = static_cast<unsigned char>(json[i]);
    const bool is_pair = byte == 0xc2 && i + 1 < json.size() && static_cast<unsigned char>(json[i + 1]) < 0xa0;
    if (is_pair || byte == 0x7f)
      result += fmt::format("\\u{:04x}", is_pair ? static_cast<unsigned char>(json[++i]) : byte);
    else
      result += json[i];
  }
  return result;
}

}  // namespace

void write_json(const std::string& target, const Json& json) {
  if (target.empty()) return;
  const std::string text = json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
  if (target == "-")
    write_to_terminal(json_printable(text));
  else
    write_text_atomically(target, text);
}

void print(const std::string& json_target, const std::string& text) {
  if (json_target == "-") return;
  write_to_terminal(printable(text));
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

namespace {

MeshFile read_and_tell(const std::filesystem::path& path) {
  MeshFile file = read_mesh(path);
  if (file.triangles != file.faces_in_file)
    spdlog::info("{}: {} polygons became {} triangles", path.string(), file.faces_in_file, file.triangles);
  if (file.merged_vertices > 0)
    spdlog::info("{}: {} of {} vertices lay on others and were welded", path.string(), file.merged_vertices,
                 file.vertices_in_file);
  if (file.ends_in_face && !measure_manifold(file.mesh).is_closed_manifold())
    warn(fmt::format("{}: the file ends within a line, and its surface is not closed; it may have been cut on its way",
                     path.string()));
  return file;
}

}  // namespace

TriangleMesh load_mesh(const std::filesystem::path& path) { return read_and_tell(path).mesh; }

MeshFile load_mesh_file(const std::filesystem::path& path, bool has_materials) {
  MeshFile file = read_and_tell(path);
  if (!has_materials) return file;
  for (const std::string& sentence : read_materials(path, file)) warn(sentence);
  return file;
}

namespace {

/// Prints every finding to standard error.
/// \throw CLI::RuntimeError(kExitBad) when one is an error
void report_findings(const std::vector<Finding>& findings) {
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

}  // namespace

void require_valid(TriangleMesh& mesh, const Skeleton& skeleton, std::optional<TriangleTree>* tree) {
  report_findings(validate_before_segmentation(mesh, skeleton, tree));
}

TriangleTree require_closed(TriangleMesh& mesh) {
  std::optional<TriangleTree> tree;
  report_findings(validate_mesh(mesh, &tree));
  return std::move(*tree);
}

Vec3 parse_direction(const char* option, const std::string& text) {
  const bool is_negative = text.starts_with('-');
  const std::string word = text.substr(is_negative || text.starts_with('+') ? 1 : 0);
  for (int axis = 0; axis < 3; ++axis)
    if (word == std::string(1, "xyz"[axis]) || word == std::string(1, "XYZ"[axis]))
      return (is_negative ? -1 : 1) * Vec3::Unit(axis);
  Vec3 v;
  const char* at = text.data();
  const char* const end = at + text.size();
  for (int axis = 0; axis < 3; ++axis) {
    const auto [rest, code] = std::from_chars(at, end, v[axis]);
    const bool is_last = axis == 2;
    if (code != std::errc() || !(std::abs(v[axis]) <= 1e15) || (is_last ? rest != end : rest == end || *rest != ','))
      throw CLI::ValidationError(
          option, "\"" + text + "\" is no direction; give an axis such as y or -z, or three numbers such as 0,1,0");
    at = rest + 1;
  }
  return v;
}

std::array<int, 2> parse_size(const std::string& text, int least, int most, std::string_view unit) {
  std::array<int, 2> size{0, 0};
  const char* const end = text.data() + text.size();
  auto [rest, code] = std::from_chars(text.data(), end, size[0]);
  size[1] = size[0];
  if (code == std::errc() && rest != end && (*rest == 'x' || *rest == 'X')) {
    const auto second = std::from_chars(rest + 1, end, size[1]);
    rest = second.ptr;
    code = second.ec;
  }
  const auto [smaller, larger] = std::minmax(size[0], size[1]);
  if (code != std::errc() || rest != end || smaller < least || larger > most)
    throw CLI::ValidationError(
        "--size", fmt::format("\"{}\" is no size; give N or WIDTHxHEIGHT, {} to {} {}, e.g. 512 or 1200x900", text,
                              least, most, unit));
  return size;
}

Json profile_json(ClContext& context) {
  Json list = Json::array();
  for (const ClProfileEntry& entry : context.profile())
    list.push_back({{"kernel", entry.kernel}, {"launches", entry.launches}, {"ms", entry.milliseconds}});
  return list;
}

}  // namespace skeletex::cli
