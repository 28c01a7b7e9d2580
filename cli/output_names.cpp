// SPDX-License-Identifier: MIT
#include "output_names.h"

#include <fmt/format.h>
#include <glob.h>

#include <algorithm>
#include <filesystem>

#include "command.h"
#include "files.h"
#include "skeletex/model/error.h"

namespace skeletex::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kName = "{name}";

std::vector<std::string> matches_of(const std::string& pattern) {
  ::glob_t found{};
  std::vector<std::string> paths;
  if (::glob(pattern.c_str(), 0, nullptr, &found) == 0) paths.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
  ::globfree(&found);
  if (paths.empty()) throw InputError(fmt::format("{}: no file matches this; is it the right folder?", pattern));
  return paths;
}

/// The output of a pose.
std::string named(std::string output, const std::string& pose) {
  const std::string name = fs::path(pose).stem().string();
  for (std::size_t at = 0; (at = output.find(kName, at)) != std::string::npos; at += name.size())
    output.replace(at, std::string(kName).size(), name);
  return output;
}

}  // namespace

std::string numbered(const std::string& path, std::size_t number) {
  const fs::path file(path);
  std::string name = file.filename().string();
  name.insert(std::min(name.find('.', 1), name.size()), fmt::format("_{:03}", number));
  return (file.parent_path() / name).string();
}

bool is_pattern(const std::string& path) {
  std::error_code ignored;
  return path.find_first_of("*?[") != std::string::npos && !fs::exists(path, ignored);
}

std::vector<PoseOutput> pose_outputs(const CLI::App& command, const std::string& pose, const std::string& output) {
  if (pose.empty()) return {{"", output}};
  std::vector<PoseOutput> outputs;
  for (const std::string& path : is_pattern(pose) ? matches_of(pose) : std::vector{pose})
    outputs.push_back({path, named(output, path)});
  if (outputs.size() > 1 && output.find(kName) == std::string::npos)
    throw CLI::ValidationError("--output",
                               fmt::format("\"{}\" is one file for {} poses; put {} into it, for example "
                                           "{}_{}",
                                           output, outputs.size(), kName, kName, fs::path(output).filename().string()));
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    if (outputs[i].output == output) continue;
    check_made_output(command, outputs[i].output);
    check_output(outputs[i].output);
    for (std::size_t j = 0; j < i; ++j)
      if (outputs[j].output == outputs[i].output)
        throw CLI::ValidationError("--pose", fmt::format("{} and {} have the same name, so both would be {}",
                                                         outputs[j].pose, outputs[i].pose, outputs[i].output));
  }
  return outputs;
}

}  // namespace skeletex::cli
