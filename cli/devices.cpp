// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <memory>

#include "command.h"
#include "skeletex/model/error.h"
#include "table.h"

namespace skeletex::cli {
namespace {

/// "OpenCL 3.0 and what the vendor adds" without what the vendor adds.
std::string short_version(const std::string& version) {
  return version.substr(0, version.find(' ', version.find(' ') + 1));
}

void run(const std::string& json_target) {
  const std::vector<ClDeviceInfo> devices = list_devices();
  const double gib = 1024.0 * 1024.0 * 1024.0;
  Table table({"device", "type", "platform", "version", "driver", "units", "memory GiB", "buffer GiB", "double"});
  Json list = Json::array();
  for (const ClDeviceInfo& device : devices) {
    table.add({fmt::format("{}: {}", device.index, device.name), device.type, device.platform,
               short_version(device.version), device.driver, fmt::format("{}", device.compute_units),
               fmt::format("{:.1f}", static_cast<double>(device.global_memory_bytes) / gib),
               fmt::format("{:.1f}", static_cast<double>(device.max_allocation_bytes) / gib),
               device.has_double ? "yes" : "no"});
    list.push_back({{"index", device.index},
                    {"name", device.name},
                    {"type", device.type},
                    {"platform", device.platform},
                    {"driver", device.driver},
                    {"version", device.version},
                    {"compute_units", device.compute_units},
                    {"global_memory_bytes", device.global_memory_bytes},
                    {"max_allocation_bytes", device.max_allocation_bytes},
                    {"max_work_group_size", device.max_work_group_size},
                    {"has_double", device.has_double}});
  }
  if (!devices.empty()) {
    list[ClContext().device().index]["default"] = true;
    print(json_target, table.text() + fmt::format("default: {}\n", ClContext().device().name));
  }
  write_json(json_target, {{"devices", std::move(list)}});
  if (devices.empty())
    throw DeviceError(
        "no OpenCL device found; install a driver (Debian: apt-get install pocl-opencl-icd runs OpenCL on the CPU)");
}

}  // namespace

void add_devices_command(CLI::App& program) {
  auto json = std::make_shared<std::string>();
  CLI::App& command = *program.add_subcommand("devices", "List the OpenCL devices");
  add_json_option(command, *json);
  command.footer(
      "Example:\n"
      "  skeletex devices\n"
      "Choose one with --device of the other commands, or with the variable SKELETEX_DEVICE.");
  command.callback([json] { run(*json); });
}

}  // namespace skeletex::cli
