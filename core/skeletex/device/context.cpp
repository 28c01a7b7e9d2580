// SPDX-License-Identifier: MIT
#include "skeletex/device/context.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <functional>

#include "skeletex/device/kernel_source.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// Work-items of a group where the caller leaves it open. Drivers choose by the number of work-items, and one that
/// compiles for every size of group (PoCL) would compile again for every mesh.
constexpr std::size_t kGroupSize = 64;

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

const char* to_words(ClArgument kind) {
  switch (kind) {
    case ClArgument::kBuffer: return "a buffer";
    case ClArgument::kLocal: return "local memory";
    case ClArgument::kInt: return "an int";
    case ClArgument::kUnsigned: return "an unsigned";
    case ClArgument::kFloat: return "a float";
    case ClArgument::kStruct: return "a struct";
    default: return "another kind of value";
  }
}

/// kUnknown where the driver keeps no names (it need not for programs from binaries) or the type is another.
ClArgument argument_kind(const ::cl::Kernel& kernel, cl_uint index) {
  cl_kernel_arg_address_qualifier address = CL_KERNEL_ARG_ADDRESS_PRIVATE;
  if (kernel.getArgInfo(index, CL_KERNEL_ARG_ADDRESS_QUALIFIER, &address) != CL_SUCCESS) return ClArgument::kUnknown;
  if (address == CL_KERNEL_ARG_ADDRESS_LOCAL) return ClArgument::kLocal;
  if (address != CL_KERNEL_ARG_ADDRESS_PRIVATE) return ClArgument::kBuffer;
  std::string type;
  if (kernel.getArgInfo(index, CL_KERNEL_ARG_TYPE_NAME, &type) != CL_SUCCESS) return ClArgument::kUnknown;
  while (!type.empty() && type.back() == '\0') type.pop_back();
  if (type == "float") return ClArgument::kFloat;
  if (type == "int") return ClArgument::kInt;
  if (type == "uint" || type == "unsigned int" || type == "unsigned") return ClArgument::kUnsigned;
  return ClArgument::kUnknown;
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

}  // namespace

std::vector<ClDeviceInfo> list_devices() {
  std::vector<ClDeviceInfo> infos;
  for (auto& [info, device] : enumerate()) infos.push_back(std::move(info));
  return infos;
}

ClContext::ClContext(const std::string& selector) {
  const auto devices = enumerate();
  if (devices.empty())
    throw DeviceError(
        "no OpenCL device found; install a driver (Debian: apt-get install pocl-opencl-icd runs OpenCL on the CPU)");
  std::string wanted = selector;
  if (wanted.empty())
    if (const char* variable = std::getenv("SKELETEX_DEVICE")) wanted = variable;
  wanted = lower(wanted);

  const auto pick = [&](const std::function<bool(const ClDeviceInfo&)>& accepts) {
    const auto it = std::find_if(devices.begin(), devices.end(), [&](const auto& d) { return accepts(d.first); });
    return it == devices.end() ? -1 : static_cast<int>(it - devices.begin());
  };
  int chosen = -1;
  if (wanted.empty()) {
    chosen = pick([](const ClDeviceInfo& d) { return d.type == "gpu"; });
    if (chosen < 0) chosen = 0;
  } else if (int index = -1; std::from_chars(wanted.data(), wanted.data() + wanted.size(), index).ptr ==
                             wanted.data() + wanted.size()) {
    chosen = index >= 0 && index < static_cast<int>(devices.size()) ? index : -1;
  } else {
    chosen = pick([&](const ClDeviceInfo& d) {
      return d.type == wanted || lower(d.name).find(wanted) != std::string::npos ||
             lower(d.platform).find(wanted) != std::string::npos;
    });
  }
  if (chosen < 0) {
    std::string list;
    for (const auto& [info, device] : devices)
      list += fmt::format("\n  {}: {} ({}, {})", info.index, info.name, info.type, info.platform);
    throw DeviceError(fmt::format("no OpenCL device matches \"{}\"; there are:{}", wanted, list));
  }
  info_ = devices[chosen].first;
  device_ = devices[chosen].second;
  cl_int code = CL_SUCCESS;
  context_ = ::cl::Context(device_, nullptr, nullptr, nullptr, &code);
  check(code, "creating an OpenCL context");
  queue_ = ::cl::CommandQueue(context_, device_, CL_QUEUE_PROFILING_ENABLE, &code);
  check(code, "creating an OpenCL queue");
}

ClContext::ClContext(const ClContext& other, Beside)
    : info_(other.info_), device_(other.device_), context_(other.context_), programs_(other.programs_) {
  cl_int code = CL_SUCCESS;
  queue_ = ::cl::CommandQueue(context_, device_, CL_QUEUE_PROFILING_ENABLE, &code);
  check(code, "creating an OpenCL queue");
}

ClContext::~ClContext() = default;

std::unique_ptr<ClContext> ClContext::beside() const {
  return std::unique_ptr<ClContext>(new ClContext(*this, Beside{}));
}

void ClContext::take_profile(ClContext& beside) {
  beside.collect_events();
  for (const auto& [kernel, entry] : beside.profile_) {
    ClProfileEntry& own = profile_[kernel];
    own.kernel = kernel;
    own.launches += entry.launches;
    own.milliseconds += entry.milliseconds;
  }
  beside.profile_.clear();
}

::cl::Buffer ClContext::allocate_bytes(std::size_t bytes, const void* values) {
  if (bytes > info_.max_allocation_bytes)
    throw DeviceError(
        fmt::format("{:.0f} MiB in one buffer are more than {} allows ({:.0f} MiB); ask for a smaller texture, or "
                    "choose another device",
                    mebibytes(bytes), info_.name, mebibytes(info_.max_allocation_bytes)));
  cl_int code = CL_SUCCESS;
  constexpr std::size_t kLeast = 16;
  std::array<std::byte, kLeast> few{};
  if (values && bytes < kLeast) {
    if (bytes > 0) std::memcpy(few.data(), values, bytes);
    values = few.data();
  }
  const cl_mem_flags flags = values ? CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR : CL_MEM_READ_WRITE;
  ::cl::Buffer buffer(context_, flags, std::max(bytes, kLeast), const_cast<void*>(values), &code);
  check(code, fmt::format("allocating {:.1f} MiB on {}", mebibytes(bytes), info_.name));
  return buffer;
}

void ClContext::write_bytes(const ::cl::Buffer& buffer, const void* data, std::size_t bytes) {
  if (bytes > 0) check(queue_.enqueueWriteBuffer(buffer, CL_TRUE, 0, bytes, data), "writing to the device");
}

void ClContext::read_bytes(const ::cl::Buffer& buffer, void* data, std::size_t bytes) {
  if (bytes > 0) check(queue_.enqueueReadBuffer(buffer, CL_TRUE, 0, bytes, data), "reading from the device");
}

void ClContext::read_all(std::initializer_list<Read> reads) {
  cl_int code = CL_SUCCESS;
  for (const Read& read : reads)
    if (code == CL_SUCCESS && read.bytes > 0)
      code = queue_.enqueueReadBuffer(*read.from, CL_FALSE, 0, read.bytes, read.to);
  finish();  // whatever has failed: what is queued writes to the host's memory
  check(code, "reading from the device");
}

const void* ClContext::map_bytes(const ::cl::Buffer& buffer, std::size_t bytes) {
  if (bytes == 0) return nullptr;
  cl_int code = CL_SUCCESS;
  const void* values = queue_.enqueueMapBuffer(buffer, CL_FALSE, CL_MAP_READ, 0, bytes, nullptr, nullptr, &code);
  check(code, "reading from the device");
  return values;
}

void ClContext::fill_bytes(const ::cl::Buffer& buffer, const void* pattern, std::size_t pattern_bytes,
                           std::size_t bytes) {
  if (bytes == 0) return;
  // Drivers write one pattern after the other: the longest that OpenCL takes, where that divides the size.
  std::array<std::byte, 128> repeated;
  const bool is_repeated = repeated.size() % pattern_bytes == 0 && bytes % repeated.size() == 0;
  if (is_repeated)
    for (std::size_t i = 0; i < repeated.size(); i += pattern_bytes)
      std::memcpy(repeated.data() + i, pattern, pattern_bytes);
  check(::clEnqueueFillBuffer(queue_(), buffer(), is_repeated ? repeated.data() : pattern,
                              is_repeated ? repeated.size() : pattern_bytes, 0, bytes, 0, nullptr, nullptr),
        "filling a device buffer");
}

::cl::Program ClContext::get_program(const ClKernelName& name) {
  const auto candidates =
      name.options.empty() ? programs_with(name.file) : std::vector<std::vector<std::string_view>>{{name.file}};
  const auto key_of = [&](const std::vector<std::string_view>& files) {
    return fmt::format("{}|{}", files.front(), name.options);
  };
  for (const auto& files : candidates)
    if (const auto it = programs_.find(key_of(files)); it != programs_.end()) return it->second;

  const std::vector<std::string_view>& files = candidates.front();
  const std::string options =
      fmt::format("-cl-std=CL1.2 -cl-kernel-arg-info -DROW_ITEMS={} {}", row_items(), name.options);
  // The hash guards against drivers whose kernel cache overlooks a change of options.
  const std::string body = kernel_source(files);
  const std::string source = fmt::format("// {:016x}\n{}", std::hash<std::string>{}(options + body), body);
  cl_int code = CL_SUCCESS;
  ::cl::Program built(context_, source, false, &code);
  check(code, fmt::format("{}: creating the program", name.file));
  code = built.build({device_}, options.c_str());
  if (code != CL_SUCCESS) {
    std::string log;
    built.getBuildInfo(device_, CL_PROGRAM_BUILD_LOG, &log);
    throw DeviceError(fmt::format("{}: {} on {}\n{}", name.file, describe(code), info_.name, quote_kernel_lines(log)));
  }
  return programs_.emplace(key_of(files), built).first->second;
}

const ClContext::BuiltKernel& ClContext::get_kernel(const ClKernelName& name) {
  const std::string key = fmt::format("{}|{}|{}", name.file, name.options, name.kernel);
  if (const auto it = kernels_.find(key); it != kernels_.end()) return it->second;
  cl_int code = CL_SUCCESS;
  ::cl::Kernel kernel(get_program(name), std::string(name.kernel).c_str(), &code);
  check(code, fmt::format("{}: kernel {}", name.file, name.kernel));
  cl_uint count = 0;
  check(kernel.getInfo(CL_KERNEL_NUM_ARGS, &count), fmt::format("{}: kernel {}", name.file, name.kernel));
  std::vector<ClArgument> arguments;
  for (cl_uint i = 0; i < count; ++i) arguments.push_back(argument_kind(kernel, i));
  return kernels_.emplace(key, BuiltKernel{kernel, std::move(arguments)}).first->second;
}

void ClContext::check_arguments(const BuiltKernel& kernel, const ClKernelName& name,
                                std::span<const ClArgument> given) {
  if (kernel.arguments.size() != given.size())
    throw DeviceError(fmt::format("{}: kernel {} takes {} arguments, not {}", name.file, name.kernel,
                                  kernel.arguments.size(), given.size()));
  const auto is_integer = [](ClArgument kind) { return kind == ClArgument::kInt || kind == ClArgument::kUnsigned; };
  for (std::size_t i = 0; i < given.size(); ++i)
    if (kernel.arguments[i] != ClArgument::kUnknown && kernel.arguments[i] != given[i] &&
        !(is_integer(kernel.arguments[i]) && is_integer(given[i])))
      throw DeviceError(fmt::format("{}: kernel {}, argument {}: the kernel takes {}, not {}", name.file, name.kernel,
                                    i, to_words(kernel.arguments[i]), to_words(given[i])));
}

void ClContext::check_fits(std::size_t values, std::size_t room) {
  if (values > room) throw DeviceError(fmt::format("{} values do not fit a device buffer of {}", values, room));
}

void ClContext::check_argument(cl_int code, const ClKernelName& name, unsigned index) {
  if (code != CL_SUCCESS) check(code, fmt::format("{}: kernel {}, argument {}", name.file, name.kernel, index));
}

void ClContext::enqueue(const ::cl::Kernel& kernel, const ClKernelName& name, const ClRange& range) {
  if (range.global[0] == 0 || range.global[1] == 0) return;
  std::array<std::size_t, 2> global = range.global, local = range.local;
  if (local[0] == 0) local = {work_group_size(name, kGroupSize), 1};
  for (int d = 0; d < 2; ++d) global[d] = (global[d] + local[d] - 1) / local[d] * local[d];
  ::cl::Event event;
  const cl_int code = queue_.enqueueNDRangeKernel(kernel, ::cl::NullRange, ::cl::NDRange(global[0], global[1]),
                                                  ::cl::NDRange(local[0], local[1]), nullptr, &event);
  if (code == CL_INVALID_WORK_GROUP_SIZE)
    throw DeviceError(
        fmt::format("{}: kernel {} cannot run in work-groups of {} x {} on {}; ask ClContext::work_group_size",
                    name.file, name.kernel, local[0], local[1], info_.name));
  check(code, fmt::format("{}: launching {}", name.file, name.kernel));
  pending_.push_back({fmt::format("{}:{}", name.file, name.kernel), event});
  if (pending_.size() >= 1024) collect_events();
}

void ClContext::compile(const ClKernelName& name, const ClRange& range) {
  constexpr std::size_t kBytes = 4096;  // enough for what kernels read before they look at how much there is to do
  const BuiltKernel& built = get_kernel(name);
  ::cl::Kernel kernel = built.kernel;
  std::vector<::cl::Buffer> buffers;
  for (cl_uint i = 0; i < built.arguments.size(); ++i) {
    const cl_int zero = 0;
    if (built.arguments[i] == ClArgument::kLocal) {
      set_argument(kernel, name, i, ClLocal{kBytes});
    } else if (built.arguments[i] == ClArgument::kBuffer) {
      buffers.push_back(allocate_bytes(kBytes));
      fill_bytes(buffers.back(), &zero, sizeof zero, kBytes);
      check_argument(kernel.setArg(i, buffers.back()), name, i);
    } else {
      // A scalar, or a struct of a size that only the driver knows.
      const std::vector<std::byte> zeros(kBytes);
      cl_int code = CL_INVALID_ARG_SIZE;
      for (std::size_t bytes = sizeof zero; code == CL_INVALID_ARG_SIZE && bytes <= kBytes; bytes += sizeof zero)
        code = ::clSetKernelArg(kernel(), i, bytes, zeros.data());
      check_argument(code, name, i);
    }
  }
  enqueue(kernel, name, range);
  finish();
  if (!pending_.empty()) pending_.pop_back();  // no launch that anybody asked for
}

void ClContext::finish() { check(queue_.finish(), "waiting for the device"); }

void ClContext::collect_events() {
  finish();
  for (const PendingEvent& pending : pending_) {
    cl_ulong begin = 0, end = 0;
    pending.event.getProfilingInfo(CL_PROFILING_COMMAND_START, &begin);
    pending.event.getProfilingInfo(CL_PROFILING_COMMAND_END, &end);
    ClProfileEntry& entry = profile_[pending.kernel];
    entry.kernel = pending.kernel;
    ++entry.launches;
    entry.milliseconds += static_cast<double>(end - begin) * 1e-6;
  }
  pending_.clear();
}

std::vector<ClProfileEntry> ClContext::profile() {
  collect_events();
  std::vector<ClProfileEntry> entries;
  for (const auto& [kernel, entry] : profile_) entries.push_back(entry);
  std::sort(entries.begin(), entries.end(),
            [](const auto& a, const auto& b) { return a.milliseconds > b.milliseconds; });
  return entries;
}

void ClContext::reset_profile() {
  collect_events();
  profile_.clear();
}

std::size_t ClContext::work_group_size(const ClKernelName& name, std::size_t wanted) {
  std::size_t limit = 1;
  get_kernel(name).kernel.getWorkGroupInfo(device_, CL_KERNEL_WORK_GROUP_SIZE, &limit);
  return std::max<std::size_t>(1, std::min(wanted, limit));
}

}  // namespace skeletex
