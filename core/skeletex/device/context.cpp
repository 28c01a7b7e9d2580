// SPDX-License-Identifier: MIT
#include "skeletex/device/context.h"

#include <fmt/format.h>

#include <CL/opencl.hpp>
#include <algorithm>
#include <cctype>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <map>

#include "skeletex/device/kernel_source.h"
#include "skeletex/device/workarounds.h"
#include "skeletex/model/error.h"

namespace skeletex {

struct ClMemory {
  ::cl::Buffer buffer;
};

namespace {

/// The OpenCL codes that a user can meet, in words.
std::string describe(cl_int code) {
  switch (code) {
    case CL_DEVICE_NOT_FOUND: return "no device found";
    case CL_DEVICE_NOT_AVAILABLE: return "the device is not available";
    case CL_COMPILER_NOT_AVAILABLE: return "the driver has no compiler";
    case CL_MEM_OBJECT_ALLOCATION_FAILURE: return "the device's memory is exhausted";
    case CL_OUT_OF_RESOURCES: return "the device ran out of resources";
    case CL_OUT_OF_HOST_MEMORY: return "the host's memory is exhausted";
    case CL_BUILD_PROGRAM_FAILURE: return "the program does not compile";
    case CL_INVALID_BUFFER_SIZE: return "the buffer is larger than the device allows";
    case CL_INVALID_KERNEL_NAME: return "the program has no such kernel";
    case CL_INVALID_ARG_INDEX: return "the kernel has no such argument";
    case CL_INVALID_ARG_SIZE: return "the argument has another size";
    case CL_INVALID_KERNEL_ARGS: return "an argument is not set";
    case CL_INVALID_WORK_GROUP_SIZE: return "the work-group does not fit the device";
    case CL_INVALID_VALUE: return "a value is out of range";
    default: return fmt::format("OpenCL error {}", code);
  }
}

void check(cl_int code, std::string_view what) {
  if (code != CL_SUCCESS) throw DeviceError(fmt::format("{}: {}", what, describe(code)));
}

double mebibytes(std::uint64_t bytes) { return static_cast<double>(bytes) / (1 << 20); }

const char* to_words(ClKind kind) {
  switch (kind) {
    case ClKind::kBuffer: return "a buffer";
    case ClKind::kLocal: return "local memory";
    case ClKind::kInt: return "an int";
    case ClKind::kUnsigned: return "an unsigned";
    case ClKind::kFloat: return "a float";
    case ClKind::kStruct: return "a struct";
    default: return "another kind of value";
  }
}

/// kUnknown where the driver keeps no names (it need not for programs from binaries) or the type is another.
ClKind argument_kind(const ::cl::Kernel& kernel, cl_uint index) {
  cl_kernel_arg_address_qualifier address = CL_KERNEL_ARG_ADDRESS_PRIVATE;
  if (kernel.getArgInfo(index, CL_KERNEL_ARG_ADDRESS_QUALIFIER, &address) != CL_SUCCESS) return ClKind::kUnknown;
  if (address == CL_KERNEL_ARG_ADDRESS_LOCAL) return ClKind::kLocal;
  if (address != CL_KERNEL_ARG_ADDRESS_PRIVATE) return ClKind::kBuffer;
  std::string type;
  if (kernel.getArgInfo(index, CL_KERNEL_ARG_TYPE_NAME, &type) != CL_SUCCESS) return ClKind::kUnknown;
  while (!type.empty() && type.back() == '\0') type.pop_back();
  if (type == "float") return ClKind::kFloat;
  if (type == "int") return ClKind::kInt;
  if (type == "uint" || type == "unsigned int" || type == "unsigned") return ClKind::kUnsigned;
  // The language's own types have small letters.
  if (type.starts_with("struct ") || (!type.empty() && std::isupper(static_cast<unsigned char>(type[0]))))
    return ClKind::kStruct;
  return ClKind::kUnknown;
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::string text_of(const ::cl::Device& device, cl_device_info what) {
  std::string text;
  device.getInfo(what, &text);
  while (!text.empty() && (text.back() == '\0' || text.back() == ' ')) text.pop_back();
  return text;
}

std::vector<std::pair<ClDeviceInfo, ::cl::Device>> enumerate() {
  workarounds::require_addresses_to_start();
  std::vector<std::pair<ClDeviceInfo, ::cl::Device>> found;
  std::vector<::cl::Platform> platforms;
  if (::cl::Platform::get(&platforms) != CL_SUCCESS) return found;
  for (const ::cl::Platform& platform : platforms) {
    std::vector<::cl::Device> devices;
    if (platform.getDevices(CL_DEVICE_TYPE_ALL, &devices) != CL_SUCCESS) continue;
    for (const ::cl::Device& device : devices) {
      ClDeviceInfo info;
      info.index = static_cast<int>(found.size());
      platform.getInfo(CL_PLATFORM_NAME, &info.platform);
      while (!info.platform.empty() && info.platform.back() == '\0') info.platform.pop_back();
      info.name = text_of(device, CL_DEVICE_NAME);
      info.driver = text_of(device, CL_DRIVER_VERSION);
      info.version = text_of(device, CL_DEVICE_VERSION);
      const auto type = device.getInfo<CL_DEVICE_TYPE>();
      info.type = (type & CL_DEVICE_TYPE_GPU) ? "gpu" : (type & CL_DEVICE_TYPE_CPU) ? "cpu" : "accelerator";
      info.compute_units = static_cast<int>(device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>());
      info.global_memory_bytes = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
      info.max_allocation_bytes = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
      info.max_work_group_size = device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>();
      info.has_double = text_of(device, CL_DEVICE_EXTENSIONS).find("cl_khr_fp64") != std::string::npos;
      found.emplace_back(std::move(info), device);
    }
  }
  return found;
}

std::string why_no_device() {
  std::vector<::cl::Platform> platforms;
  if (::cl::Platform::get(&platforms) == CL_SUCCESS && !platforms.empty())
    if (const std::string fault = workarounds::fault_of_kernel_cache(); !fault.empty())
      return "no OpenCL device found: " + fault;
  return "no OpenCL device found; install a driver (Debian: apt-get install pocl-opencl-icd runs OpenCL on the CPU)";
}

/// Position in `devices` of the one that the selector names.
/// \throw DeviceError
std::size_t choose_device(const std::vector<std::pair<ClDeviceInfo, ::cl::Device>>& devices,
                          const std::string& selector) {
  if (devices.empty()) throw DeviceError(why_no_device());
  std::string wanted = selector;
  if (wanted.empty())
    if (const char* variable = std::getenv("SKELETEX_DEVICE")) wanted = variable;
  wanted = lower(wanted);
  const auto find = [&](const auto& accepts) {
    return std::find_if(devices.begin(), devices.end(), [&](const auto& d) { return accepts(d.first); });
  };
  auto chosen = devices.end();
  int index = -1;
  if (wanted.empty()) {
    chosen = find([](const ClDeviceInfo& d) { return d.type == "gpu"; });
    if (chosen == devices.end()) chosen = devices.begin();
  } else if (std::from_chars(wanted.data(), wanted.data() + wanted.size(), index).ptr ==
             wanted.data() + wanted.size()) {
    chosen = find([&](const ClDeviceInfo& d) { return d.index == index; });
  } else {
    chosen = find([&](const ClDeviceInfo& d) {
      return d.type == wanted || lower(d.name).find(wanted) != std::string::npos ||
             lower(d.platform).find(wanted) != std::string::npos;
    });
  }
  if (chosen != devices.end()) return static_cast<std::size_t>(chosen - devices.begin());
  std::string list;
  for (const auto& [info, device] : devices)
    list += fmt::format("\n  {}: {} ({}, {})", info.index, info.name, info.type, info.platform);
  throw DeviceError(fmt::format("no OpenCL device matches \"{}\"; there are:{}", wanted, list));
}

/// \throw DeviceError unless the arguments are as many as the kernel takes, and of its kinds
void check_arguments(std::span<const ClKind> taken, const ClKernelName& name, std::span<const ClArgument> given) {
  if (taken.size() != given.size())
    throw DeviceError(
        fmt::format("{}: kernel {} takes {} arguments, not {}", name.file, name.kernel, taken.size(), given.size()));
  const auto is_integer = [](ClKind kind) { return kind == ClKind::kInt || kind == ClKind::kUnsigned; };
  for (std::size_t i = 0; i < given.size(); ++i)
    if (taken[i] != ClKind::kUnknown && taken[i] != given[i].kind &&
        !(is_integer(taken[i]) && is_integer(given[i].kind)))
      throw DeviceError(fmt::format("{}: kernel {}, argument {}: the kernel takes {}, not {}", name.file, name.kernel,
                                    i, to_words(taken[i]), to_words(given[i].kind)));
}

}  // namespace

std::vector<ClDeviceInfo> list_devices() {
  std::vector<ClDeviceInfo> infos;
  for (auto& [info, device] : enumerate()) infos.push_back(std::move(info));
  return infos;
}

struct ClContext::Driver {
  struct Kernel {
    ::cl::Kernel kernel;
    std::vector<ClKind> arguments;  ///< kUnknown where the driver does not tell
    std::vector<std::array<std::size_t, 2>> launched_groups;
  };
  struct PendingEvent {
    std::string kernel;
    ::cl::Event event;
  };
  using Clock = std::chrono::steady_clock;

  Driver(const ClDeviceInfo& info_given, ::cl::Device device_given, ::cl::Context context_given);
  ::cl::Program program(const ClKernelName& name);
  Kernel& kernel(const ClKernelName& name);
  void finish() { check(queue.finish(), "waiting for the device"); }
  void add_event(std::string name, const ::cl::Event& event);
  void collect_events();
  /// Runs what a driver may compile in.
  template <class Run>
  auto compile(const Run& run) {
    if (watch) watch(compiling_seconds);
    const auto begin = Clock::now();
    auto result = run();
    compiling_seconds += std::chrono::duration<double>(Clock::now() - begin).count();
    return result;
  }

  ClDeviceInfo info;
  ::cl::Device device;
  ::cl::Context context;
  ::cl::CommandQueue queue;
  std::map<std::string, ::cl::Program> programs;
  std::map<std::string, Kernel> kernels;
  std::vector<PendingEvent> pending;
  std::map<std::string, ClProfileEntry> profile;
  std::function<void(double seconds)> watch;
  double compiling_seconds = 0;
};

ClContext::Driver::Driver(const ClDeviceInfo& info_given, ::cl::Device device_given, ::cl::Context context_given)
    : info(info_given), device(std::move(device_given)), context(std::move(context_given)) {
  cl_int code = CL_SUCCESS;
  if (!context()) {
    context = ::cl::Context(device, nullptr, nullptr, nullptr, &code);
    check(code, "creating an OpenCL context");
  }
  queue = ::cl::CommandQueue(context, device, CL_QUEUE_PROFILING_ENABLE, &code);
  check(code, "creating an OpenCL queue");
}

::cl::Program ClContext::Driver::program(const ClKernelName& name) {
  const auto candidates =
      name.options.empty() ? programs_with(name.file) : std::vector<std::vector<std::string_view>>{{name.file}};
  const auto key_of = [&](const std::vector<std::string_view>& files) {
    return fmt::format("{}|{}", files.front(), name.options);
  };
  for (const auto& files : candidates)
    if (const auto it = programs.find(key_of(files)); it != programs.end()) return it->second;

  const std::vector<std::string_view>& files = candidates.front();
  // -w: PoCL writes the number of warnings to standard error, among them those of vectors wider than the CPU's.
  const std::string options =
      fmt::format("-cl-std=CL1.2 -cl-kernel-arg-info -w -DROW_ITEMS={} {}", workarounds::row_items(info), name.options);
  // Contraction would round otherwise on a CPU with fused operations than on one without, and at the edges of triangles
  // let rays slip between them.
  const std::string source = "#pragma OPENCL FP_CONTRACT OFF\n" + kernel_source(files);
  cl_int code = CL_SUCCESS;
  ::cl::Program built(context, workarounds::marked_source(options, source), false, &code);
  check(code, fmt::format("{}: creating the program", name.file));
  code = compile([&] { return built.build({device}, options.c_str()); });
  if (code != CL_SUCCESS) {
    std::string log;
    built.getBuildInfo(device, CL_PROGRAM_BUILD_LOG, &log);
    if (log.find("error:") == std::string::npos)  // not the source is at fault
      if (const std::string fault = workarounds::fault_of_kernel_cache(); !fault.empty())
        throw DeviceError(fmt::format("{}: not compiled on {}: {}", name.file, info.name, fault));
    throw DeviceError(fmt::format("{}: {} on {}\n{}", name.file, describe(code), info.name, quote_kernel_lines(log)));
  }
  return programs.emplace(key_of(files), built).first->second;
}

ClContext::Driver::Kernel& ClContext::Driver::kernel(const ClKernelName& name) {
  const std::string key = fmt::format("{}|{}|{}", name.file, name.options, name.kernel);
  if (const auto it = kernels.find(key); it != kernels.end()) return it->second;
  cl_int code = CL_SUCCESS;
  const ::cl::Kernel made(program(name), std::string(name.kernel).c_str(), &code);
  check(code, fmt::format("{}: kernel {}", name.file, name.kernel));
  cl_uint count = 0;
  check(made.getInfo(CL_KERNEL_NUM_ARGS, &count), fmt::format("{}: kernel {}", name.file, name.kernel));
  Kernel result{made, {}, {}};
  for (cl_uint i = 0; i < count; ++i) result.arguments.push_back(argument_kind(made, i));
  return kernels.emplace(key, std::move(result)).first->second;
}

void ClContext::Driver::add_event(std::string name, const ::cl::Event& event) {
  pending.push_back({std::move(name), event});
  if (pending.size() >= 1024) collect_events();
}

void ClContext::Driver::collect_events() {
  finish();
  for (const PendingEvent& done : pending) {
    cl_ulong begin = 0, end = 0;
    done.event.getProfilingInfo(CL_PROFILING_COMMAND_START, &begin);
    done.event.getProfilingInfo(CL_PROFILING_COMMAND_END, &end);
    ClProfileEntry& entry = profile[done.kernel];
    entry.kernel = done.kernel;
    ++entry.launches;
    entry.milliseconds += static_cast<double>(end - begin) * 1e-6;
  }
  pending.clear();
}

ClContext::ClContext(const std::string& selector) {
  const auto devices = enumerate();
  const auto& [info, device] = devices[choose_device(devices, selector)];
  info_ = info;
  driver_ = std::make_unique<Driver>(info, device, ::cl::Context());
}

ClContext::~ClContext() = default;

std::size_t ClContext::row_items() const { return workarounds::row_items(info_); }

std::shared_ptr<ClMemory> ClContext::allocate_bytes(std::size_t bytes, const void* values) {
  if (bytes > info_.max_allocation_bytes)
    throw DeviceError(
        fmt::format("{:.0f} MiB in one buffer are more than {} allows ({:.0f} MiB); ask for a smaller texture, or "
                    "choose another device",
                    mebibytes(bytes), info_.name, mebibytes(info_.max_allocation_bytes)));
  workarounds::require_addresses(info_, bytes);
  cl_int code = CL_SUCCESS;
  constexpr std::size_t kLeast = 16;  // OpenCL has no empty buffers
  std::array<std::byte, kLeast> few{};
  if (values && bytes < kLeast) {
    if (bytes > 0) std::memcpy(few.data(), values, bytes);
    values = few.data();
  }
  const cl_mem_flags flags = values ? CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR : CL_MEM_READ_WRITE;
  ::cl::Buffer buffer(driver_->context, flags, std::max(bytes, kLeast), const_cast<void*>(values), &code);
  check(code, fmt::format("allocating {:.1f} MiB on {}", mebibytes(bytes), info_.name));
  if (!values && workarounds::has_limited_addresses(info_))
    check(driver_->queue.enqueueFillBuffer(buffer, cl_uint{0}, 0, kLeast), "writing to the device");
  return std::make_shared<ClMemory>(ClMemory{std::move(buffer)});
}

void ClContext::write_bytes(ClMemory& memory, const void* data, std::size_t bytes) {
  if (bytes > 0)
    check(driver_->queue.enqueueWriteBuffer(memory.buffer, CL_TRUE, 0, bytes, data), "writing to the device");
}

void ClContext::read_bytes(const ClMemory& memory, void* data, std::size_t bytes) {
  if (bytes > 0)
    check(driver_->queue.enqueueReadBuffer(memory.buffer, CL_TRUE, 0, bytes, data), "reading from the device");
}

void ClContext::read_all(std::initializer_list<Read> reads) {
  cl_int code = CL_SUCCESS;
  for (const Read& read : reads)
    if (code == CL_SUCCESS && read.bytes > 0)
      code = driver_->queue.enqueueReadBuffer(read.from->buffer, CL_FALSE, 0, read.bytes, read.to);
  finish();  // whatever has failed: what is queued writes to the host's memory
  check(code, "reading from the device");
}

void ClContext::copy_bytes(const ClMemory& from, ClMemory& to, std::size_t bytes) {
  if (bytes == 0) return;
  ::cl::Event event;
  check(driver_->queue.enqueueCopyBuffer(from.buffer, to.buffer, 0, 0, bytes, nullptr, &event),
        "copying on the device");
  driver_->add_event("copy", event);
}

std::shared_ptr<const void> ClContext::map_bytes(const std::shared_ptr<ClMemory>& memory, std::size_t bytes) {
  if (bytes == 0) return nullptr;
  cl_int code = CL_SUCCESS;
  void* const values =
      driver_->queue.enqueueMapBuffer(memory->buffer, CL_FALSE, CL_MAP_READ, 0, bytes, nullptr, nullptr, &code);
  check(code, "reading from the device");
  return {values, [queue = driver_->queue, memory](const void* mapped) {
            ::clEnqueueUnmapMemObject(queue(), memory->buffer(), const_cast<void*>(mapped), 0, nullptr, nullptr);
          }};
}

void ClContext::fill_bytes(ClMemory& memory, const void* pattern, std::size_t pattern_bytes, std::size_t bytes) {
  if (bytes == 0) return;
  const workarounds::FillPattern filled = workarounds::longest_pattern(pattern, pattern_bytes, bytes);
  check(::clEnqueueFillBuffer(driver_->queue(), memory.buffer(), filled.bytes.data(), filled.size, 0, bytes, 0, nullptr,
                              nullptr),
        "filling a device buffer");
}

void ClContext::check_fits(std::size_t values, std::size_t room) {
  if (values > room) throw DeviceError(fmt::format("{} values do not fit a device buffer of {}", values, room));
}

void ClContext::launch_with(const ClKernelName& name, const ClRange& range, std::span<const ClArgument> arguments) {
  Driver::Kernel& kernel = driver_->kernel(name);
  check_arguments(kernel.arguments, name, arguments);
  for (cl_uint i = 0; i < arguments.size(); ++i) {
    const ClArgument& given = arguments[i];
    const cl_int code =
        given.kind == ClKind::kBuffer
            ? ::clSetKernelArg(kernel.kernel(), i, sizeof(cl_mem), &static_cast<const ClMemory*>(given.value)->buffer())
            : ::clSetKernelArg(kernel.kernel(), i, given.bytes, given.value);
    if (code != CL_SUCCESS) check(code, fmt::format("{}: kernel {}, argument {}", name.file, name.kernel, i));
  }
  if (range.global[0] == 0 || range.global[1] == 0) return;
  std::array<std::size_t, 2> global = range.global, local = range.local;
  if (local[0] == 0) local = {work_group_size(name, workarounds::kGroupSize), 1};
  for (int d = 0; d < 2; ++d) global[d] = (global[d] + local[d] - 1) / local[d] * local[d];
  ::cl::Event event;
  const auto enqueue = [&] {
    return driver_->queue.enqueueNDRangeKernel(kernel.kernel, ::cl::NullRange, ::cl::NDRange(global[0], global[1]),
                                               ::cl::NDRange(local[0], local[1]), nullptr, &event);
  };
  auto& launched = kernel.launched_groups;
  const bool is_first = std::find(launched.begin(), launched.end(), local) == launched.end();
  const cl_int code = is_first ? driver_->compile(enqueue) : enqueue();
  if (is_first) launched.push_back(local);
  if (code == CL_INVALID_WORK_GROUP_SIZE)
    throw DeviceError(
        fmt::format("{}: kernel {} cannot run in work-groups of {} x {} on {}; ask ClContext::work_group_size",
                    name.file, name.kernel, local[0], local[1], info_.name));
  check(code, fmt::format("{}: launching {}", name.file, name.kernel));
  driver_->add_event(fmt::format("{}:{}", name.file, name.kernel), event);
}

void ClContext::finish() { driver_->finish(); }

void ClContext::prepare(const ClKernelName& name) { driver_->program(name); }

void ClContext::watch_compiling(std::function<void(double seconds)> watch) { driver_->watch = std::move(watch); }

std::vector<ClProfileEntry> ClContext::profile() {
  driver_->collect_events();
  std::vector<ClProfileEntry> entries;
  for (const auto& [kernel, entry] : driver_->profile) entries.push_back(entry);
  std::sort(entries.begin(), entries.end(),
            [](const auto& a, const auto& b) { return a.milliseconds > b.milliseconds; });
  return entries;
}

void ClContext::reset_profile() {
  driver_->collect_events();
  driver_->profile.clear();
}

std::size_t ClContext::work_group_size(const ClKernelName& name, std::size_t wanted) {
  std::size_t limit = 1;
  driver_->kernel(name).kernel.getWorkGroupInfo(driver_->device, CL_KERNEL_WORK_GROUP_SIZE, &limit);
  return std::max<std::size_t>(1, std::min(wanted, limit));
}

}  // namespace skeletex
