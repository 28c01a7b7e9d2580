// SPDX-License-Identifier: MIT
#pragma once
#include <CL/opencl.hpp>
#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace skeletex {

struct ClDeviceInfo {
  int index = 0;         ///< position in list_devices()
  std::string platform;  ///< "Portable Computing Language"
  std::string name;
  std::string driver;
  std::string version;  ///< "OpenCL 3.0 ..."
  std::string type;     ///< "cpu", "gpu", "accelerator"
  int compute_units = 0;
  std::uint64_t global_memory_bytes = 0;
  std::uint64_t max_allocation_bytes = 0;
  std::size_t max_work_group_size = 0;
  bool has_double = false;
};

/// All devices of all platforms, in the driver loader's order; empty where no driver is installed.
std::vector<ClDeviceInfo> list_devices();

/// Device memory for `size` values of T. Owned; moves.
template <class T>
struct ClBuffer {
  ::cl::Buffer memory;
  std::size_t size = 0;
};

/// What a buffer holds, for the host to read as long as this lives: no copy where device and host share memory. Nothing
/// may write to the buffer meanwhile.
template <class T>
class ClMapping {
 public:
  ClMapping() = default;
  ClMapping(::cl::CommandQueue queue, ::cl::Buffer memory, const void* values, std::size_t size)
      : queue_(std::move(queue)), memory_(std::move(memory)), values_(static_cast<const T*>(values)), size_(size) {}
  ClMapping(ClMapping&& other) noexcept { *this = std::move(other); }
  ClMapping& operator=(ClMapping&& other) noexcept {
    std::swap(queue_, other.queue_), std::swap(memory_, other.memory_), std::swap(values_, other.values_),
        std::swap(size_, other.size_);
    return *this;
  }
  ~ClMapping() {
    if (values_) ::clEnqueueUnmapMemObject(queue_(), memory_(), const_cast<T*>(values_), 0, nullptr, nullptr);
  }

  const T* data() const { return values_; }
  std::size_t size() const { return size_; }
  const T& operator[](std::size_t i) const { return values_[i]; }

 private:
  ::cl::CommandQueue queue_;
  ::cl::Buffer memory_;
  const T* values_ = nullptr;
  std::size_t size_ = 0;
};

/// Work-group local memory of `bytes`, as a kernel argument.
struct ClLocal {
  std::size_t bytes;
};

/// A kernel by its file in `kernels/` and its name; `options` are -D flags.
struct ClKernelName {
  std::string_view file;  ///< "vsm.cl"
  std::string_view kernel;
  std::string_view options = "";
};

/// Global and local size of a launch. A local size of 0 leaves it to the context, which takes groups of 64 x 1. The
/// global size is rounded up to a multiple of it, so every kernel tests its bounds first.
struct ClRange {
  std::array<std::size_t, 2> global{1, 1};
  std::array<std::size_t, 2> local{0, 0};
  ClRange(std::size_t x) : global{x, 1} {}
  ClRange(std::size_t x, std::size_t y) : global{x, y} {}
  ClRange(std::array<std::size_t, 2> global_size, std::array<std::size_t, 2> local_size)
      : global(global_size), local(local_size) {}
};

/// Time on the device that the launches of one kernel took together.
struct ClProfileEntry {
  std::string kernel;
  int launches = 0;
  double milliseconds = 0;
};

/// What kind of value a kernel takes as an argument, or is given.
enum class ClArgument { kUnknown, kBuffer, kLocal, kInt, kUnsigned, kFloat, kStruct };

/// The one owner of OpenCL state: device, context, an in-order queue, programs and profiling events.
/// Not safe for use by several threads at once.
class ClContext {
 public:
  /// \param selector  index of list_devices(), or a part of a device's or platform's name (any case), or "cpu" / "gpu";
  ///                  empty: the variable SKELETEX_DEVICE, else the first GPU, else the first device
  /// \throw DeviceError listing the devices when none matches
  explicit ClContext(const std::string& selector = "");
  ~ClContext();
  ClContext(const ClContext&) = delete;
  ClContext& operator=(const ClContext&) = delete;

  /// A queue of another thread's own, with the same device, buffers and programs. Neither queue waits for the other:
  /// `finish` before the other one uses what this one makes.
  std::unique_ptr<ClContext> beside() const;
  /// Whether another thread may use that queue while this one is used, as OpenCL has it: Oclgrind runs one kernel at a
  /// time.
  bool can_run_beside() const { return info_.platform != "Oclgrind"; }
  /// Adds what was launched on such a queue to the profile. Waits for it.
  void take_profile(ClContext& beside);

  const ClDeviceInfo& device() const { return info_; }

  /// Memory for `size` values, not initialised.
  /// \throw DeviceError when it is more than the device allows in one buffer, or has left
  template <class T>
  ClBuffer<T> allocate(std::size_t size) {
    static_assert(std::is_trivially_copyable_v<T>);
    return {allocate_bytes(size * sizeof(T)), size};
  }
  /// A device copy of host values, made with the buffer: it does not wait for the queue. An empty span gives a buffer
  /// of one value, as OpenCL has no empty ones.
  template <class T>
  ClBuffer<std::remove_const_t<T>> upload(std::span<T> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    return {allocate_bytes(values.size_bytes(), values.data()), values.size()};
  }
  template <class T>
  ClBuffer<T> upload(const std::vector<T>& values) {
    return upload(std::span<const T>(values));
  }
  /// Waits for the queue and copies host values to the front of a buffer. \throw DeviceError when they do not fit
  template <class T>
  void write(ClBuffer<T>& buffer, const std::vector<T>& values) {
    check_fits(values.size(), buffer.size);
    write_bytes(buffer.memory, values.data(), values.size() * sizeof(T));
  }
  /// Waits for the queue and copies the whole buffer to the host.
  template <class T>
  std::vector<T> download(const ClBuffer<T>& buffer) {
    std::vector<T> values(buffer.size);
    read_bytes(buffer.memory, values.data(), values.size() * sizeof(T));
    return values;
  }
  /// The same of several buffers, waiting once.
  template <class... T>
  requires(sizeof...(T) > 1) std::tuple<std::vector<T>...> download(const ClBuffer<T>&... buffers) {
    std::tuple<std::vector<T>...> all{std::vector<T>(buffers.size)...};
    std::apply(
        [&](auto&... values) {
          read_all({{&buffers.memory, values.data(), values.size() * sizeof(T)}...});
        },
        all);
    return all;
  }
  /// Waits for the queue and lets the host read the whole buffer where it is. \throw DeviceError when the driver does
  /// not
  template <class T>
  ClMapping<T> map(const ClBuffer<T>& buffer) {
    return std::get<0>(map_all(buffer));
  }
  /// The same of several buffers, waiting once.
  template <class... T>
  requires(sizeof...(T) > 1) std::tuple<ClMapping<T>...> map(const ClBuffer<T>&... buffers) {
    return map_all(buffers...);
  }
  /// Sets every byte of the buffer to that of a repeated 4-byte pattern.
  template <class T>
  void fill(ClBuffer<T>& buffer, std::type_identity_t<T> value) {
    static_assert(sizeof(T) == 4);
    fill_bytes(buffer.memory, &value, sizeof(T), buffer.size * sizeof(T));
  }

  /// Queues a kernel. Arguments: ClBuffer, ClLocal, scalars of the kernel's own types (int, unsigned, float), or a
  /// struct of such, which a header in kernels/ shares with the kernel. Programs are built on first use and kept, see
  /// programs_with. \throw DeviceError naming the kernel, the failing call and its code in words; the argument whose
  /// number or kind is
  ///        not the kernel's own (kinds where the driver tells them); for a build the log with the kernel file's lines
  template <class... Args>
  void launch(const ClKernelName& name, const ClRange& range, const Args&... args) {
    const BuiltKernel& kernel = get_kernel(name);
    constexpr std::array<ClArgument, sizeof...(Args)> kinds{kind_of(static_cast<const Args*>(nullptr))...};
    check_arguments(kernel, name, kinds);
    unsigned index = 0;
    (set_argument(kernel.kernel, name, index++, args), ...);
    enqueue(kernel.kernel, name, range);
  }
  void finish();

  /// Builds or loads the program of a kernel before its first launch.
  void prepare(const ClKernelName& name) { get_kernel(name); }
  /// Has the driver compile a kernel for a size of groups, by a launch with zeros for all its arguments and in its
  /// buffers, which must do nothing. Most drivers have compiled it with its program, but PoCL does so at the first
  /// launch with that size. \throw DeviceError as launch
  void compile(const ClKernelName& name, const ClRange& range);

  /// Launches since the last reset, by kernel, longest first. Waits for the queue.
  std::vector<ClProfileEntry> profile();
  void reset_profile();

  /// Work-items of a group where a kernel has one group per row of a lattice: a loop of one over the columns on a CPU,
  /// neighbouring columns side by side on all else. Kernels know it as ROW_ITEMS: with a step that the compiler knows,
  /// PoCL makes vector instructions of such a loop before other passes pair up what is in it.
  std::size_t row_items() const {
    return info_.type == "cpu" ? 1 : std::min<std::size_t>(128, info_.max_work_group_size);
  }

  /// The largest work-group, at most `wanted`, that this kernel can run with here.
  std::size_t work_group_size(const ClKernelName& name, std::size_t wanted);

  const ::cl::Context& handle() const { return context_; }
  const ::cl::CommandQueue& queue() const { return queue_; }

 private:
  struct BuiltKernel {
    ::cl::Kernel kernel;
    std::vector<ClArgument> arguments;  ///< kUnknown where the driver does not tell
  };
  const BuiltKernel& get_kernel(const ClKernelName& name);
  ::cl::Program get_program(const ClKernelName& name);
  static void check_arguments(const BuiltKernel& kernel, const ClKernelName& name, std::span<const ClArgument> given);
  static void check_fits(std::size_t values, std::size_t room);
  ::cl::Buffer allocate_bytes(std::size_t bytes, const void* values = nullptr);
  void write_bytes(const ::cl::Buffer& buffer, const void* data, std::size_t bytes);
  void read_bytes(const ::cl::Buffer& buffer, void* data, std::size_t bytes);
  struct Read {
    const ::cl::Buffer* from;
    void* to;
    std::size_t bytes;
  };
  void read_all(std::initializer_list<Read> reads);
  const void* map_bytes(const ::cl::Buffer& buffer, std::size_t bytes);  ///< read once the queue has come by
  template <class... T>
  std::tuple<ClMapping<T>...> map_all(const ClBuffer<T>&... buffers) {
    std::tuple<ClMapping<T>...> all{
        ClMapping<T>(queue_, buffers.memory, map_bytes(buffers.memory, buffers.size * sizeof(T)), buffers.size)...};
    finish();
    return all;
  }
  void fill_bytes(const ::cl::Buffer& buffer, const void* pattern, std::size_t pattern_bytes, std::size_t bytes);
  void enqueue(const ::cl::Kernel& kernel, const ClKernelName& name, const ClRange& range);
  static void check_argument(cl_int code, const ClKernelName& name, unsigned index);

  template <class T>
  static constexpr ClArgument kind_of(const ClBuffer<T>*) {
    return ClArgument::kBuffer;
  }
  static constexpr ClArgument kind_of(const ClLocal*) { return ClArgument::kLocal; }
  template <class T>
  requires std::is_class_v<T>
  static constexpr ClArgument kind_of(const T*) { return ClArgument::kStruct; }
  template <class T>
  requires std::is_arithmetic_v<T>
  static constexpr ClArgument kind_of(const T*) {
    return std::is_floating_point_v<T> ? ClArgument::kFloat
           : std::is_signed_v<T>       ? ClArgument::kInt
                                       : ClArgument::kUnsigned;
  }
  template <class T>
  static void set_argument(const ::cl::Kernel& kernel, const ClKernelName& name, unsigned index,
                           const ClBuffer<T>& buffer) {
    check_argument(::clSetKernelArg(kernel(), index, sizeof(cl_mem), &buffer.memory()), name, index);
  }
  static void set_argument(const ::cl::Kernel& kernel, const ClKernelName& name, unsigned index, const ClLocal& local) {
    check_argument(::clSetKernelArg(kernel(), index, local.bytes, nullptr), name, index);
  }
  template <class T>
  requires std::is_arithmetic_v<T>
  static void set_argument(const ::cl::Kernel& kernel, const ClKernelName& name, unsigned index, const T& value) {
    static_assert(sizeof(T) == 4, "pass int, unsigned or float: the kernel's own type");
    check_argument(::clSetKernelArg(kernel(), index, sizeof(T), &value), name, index);
  }
  template <class T>
  requires std::is_class_v<T>
  static void set_argument(const ::cl::Kernel& kernel, const ClKernelName& name, unsigned index, const T& value) {
    static_assert(std::is_trivially_copyable_v<T>, "a kernel takes a struct of scalars by value");
    check_argument(::clSetKernelArg(kernel(), index, sizeof(T), &value), name, index);
  }

  struct Beside {};
  ClContext(const ClContext& other, Beside);

  struct PendingEvent {
    std::string kernel;
    ::cl::Event event;
  };
  void collect_events();

  ClDeviceInfo info_;
  ::cl::Device device_;
  ::cl::Context context_;
  ::cl::CommandQueue queue_;
  std::map<std::string, ::cl::Program> programs_;
  std::map<std::string, BuiltKernel> kernels_;
  std::vector<PendingEvent> pending_;
  std::map<std::string, ClProfileEntry> profile_;
};

}  // namespace skeletex
