// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <memory>

#include "command.h"
#include "compile_kernels.h"
#include "skeletex/model/error.h"
#include "table.h"

namespace skeletex::cli {
namespace {

/// "OpenCL 3.0 and what the vendor adds" without what the vendor adds.
std::string short_version(const std::string& version) {
  return version.substr(0, version.find(' ', version.find(' ') + 1));
}

struct Arguments {
  std::string device, json;
  bool is_compiling = false;
};

void run_compile(const Arguments& arguments) {
  ClContext context(arguments.device), metro_context(arguments.device);
  Stopwatch watch;
  {
    ProgressBar bar(context);
    compile_kernels(context, metro_context, bar);
  }
  context.take_profile(metro_context);
  const double seconds = watch.lap_ms() / 1000;
  print(arguments.json, fmt::format("kernels compiled for {} in {:.1f} s\n", context.device().name, seconds));
  write_json(arguments.json,
             {{"device", context.device().name}, {"seconds", seconds}, {"kernels", profile_json(context)}});
}

void run_list(const std::string& json_target) {
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
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("devices", "List the OpenCL devices, or compile all kernels ahead");
  CLI::Option* compile = command.add_flag("--compile", arguments->is_compiling,
                                          "compile all kernels for a device now; else commands do so when they first "
                                          "need them");
  add_device_option(command, arguments->device);
  command.get_option("--device")->needs(compile);
  add_json_option(command, arguments->json);
  command.footer(
      "Example:\n"
      "  skeletex devices\n"
      "  skeletex devices --compile\n"
      "Choose one with --device of the other commands, or with the variable SKELETEX_DEVICE.");
  command.callback([arguments] {
    if (arguments->is_compiling)
      run_compile(*arguments);
    else
      run_list(arguments->json);
  });
}

}  // namespace skeletex::cli
