// SPDX-License-Identifier: MIT
#include "record.h"

#include <OpenEXR/OpenEXRConfig.h>
#include <OpenMesh/Core/System/config.h>
#include <fmt/format.h>
#include <sys/utsname.h>

#include <Eigen/Core>
#include <array>
#include <cstdio>
#include <fstream>
#include <memory>
#include <thread>

#include "skeletex/device/context.h"
#include "skeletex/io/read_file.h"

namespace skeletex {
namespace {

/// First line of what a command prints, "" when it fails.
std::string output_of(const char* command) {
  const std::unique_ptr<std::FILE, decltype(&::pclose)> pipe(::popen(command, "r"), ::pclose);
  std::array<char, 256> line{};
  if (!pipe || !std::fgets(line.data(), line.size(), pipe.get())) return "";
  std::string text = line.data();
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text;
}

std::string processor_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "";
}

}  // namespace

std::string hash_text(std::string_view text) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return fmt::format("fnv1a64:{:016x}", hash);
}

std::string hash_file(const std::filesystem::path& path) { return hash_text(read_file(path)); }

OrderedJson describe_checkout() {
  const std::string commit = output_of("git rev-parse HEAD 2>/dev/null");
  return {{"commit", commit},
          {"changed_files", commit.empty() ? "" : output_of("git status --porcelain 2>/dev/null | wc -l")}};
}

OrderedJson describe_build_and_machine(const std::string& device_selector) {
  const ClContext context(device_selector);
  const ClDeviceInfo& device = context.device();
  utsname system{};
  ::uname(&system);
  return {
      {"version", SKELETEX_VERSION},
      {"compiler", SKELETEX_COMPILER},
      {"libraries",
       {{"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
        {"openmesh", fmt::format("{:x}", OM_VERSION)},
        {"openexr", OPENEXR_VERSION_STRING}}},
      {"device",
       {{"name", device.name}, {"platform", device.platform}, {"version", device.version}, {"driver", device.driver}}},
      {"machine",
       {{"system", fmt::format("{} {} {}", system.sysname, system.release, system.machine)},
        {"processor", processor_name()},
        {"cores", std::thread::hardware_concurrency()}}}};
}

}  // namespace skeletex
