// SPDX-License-Identifier: MIT
#include "skeletex/cl/kernel_source.h"

#include <fmt/format.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

std::string load(std::string_view file) {
  if (const char* folder = std::getenv("SKELETEX_KERNEL_DIR"); folder && *folder) {
    const std::string path = fmt::format("{}/{}", folder, file);
    std::ifstream in(path, std::ios::binary);
    if (!in) throw DeviceError(fmt::format("{}: no such kernel file; check SKELETEX_KERNEL_DIR", path));
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
  }
  for (const EmbeddedKernelFile& embedded : embedded_kernel_files())
    if (embedded.name == file) return std::string(embedded.text);
  throw DeviceError(fmt::format("the library holds no kernel file \"{}\"", file));
}

}  // namespace

std::string kernel_source(std::string_view file) {
  std::istringstream in(load(file));
  std::string out, line;
  int number = 0;
  while (std::getline(in, line)) {
    ++number;
    constexpr std::string_view kInclude = "#include \"";
    if (line.starts_with(kInclude)) {
      const std::string included = line.substr(kInclude.size(), line.find('"', kInclude.size()) - kInclude.size());
      out += fmt::format("#line 1 \"{}\"\n{}#line {} \"{}\"\n", included, load(included), number + 1, file);
    } else {
      out += line;
      out += '\n';
    }
  }
  return out;
}

}  // namespace skeletex
