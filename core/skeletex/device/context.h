// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <initializer_list>
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

/// The driver's buffer.
struct ClMemory;

/// Device memory for `size` values of T. Copies share it.
template <class T>
struct ClBuffer {
  std::shared_ptr<ClMemory> memory;
  std::size_t size = 0;
};

/// What a buffer holds, for the host to read as long as this lives: no copy where device and host share memory. Nothing
/// may write to the buffer meanwhile.
template <class T>
class ClMapping {
 public:
  ClMapping() = default;
  ClMapping(std::shared_ptr<const void> values, std::size_t size) : values_(std::move(values)), size_(size) {}

  const T* data() const { return static_cast<const T*>(values_.get()); }
  std::size_t size() const { return size_; }
  const T& operator[](std::size_t i) const { return data()[i]; }

 private:
  std::shared_ptr<const void> values_;
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
enum class ClKind { kUnknown, kBuffer, kLocal, kInt, kUnsigned, kFloat, kStruct };

/// An argument of a launch: a ClBuffer, ClLocal, a scalar of the kernel's own type (int, unsigned, float), or a struct
/// of such. Refers to the value.
struct ClArgument {
  ClKind kind = ClKind::kUnknown;
  std::size_t bytes = 0;
  const void* value = nullptr;  ///< of a buffer its ClMemory; of local memory none

  template <class T>
  ClArgument(const ClBuffer<T>& buffer) : kind(ClKind::kBuffer), value(buffer.memory.get()) {}
  ClArgument(const ClLocal& local) : kind(ClKind::kLocal), bytes(local.bytes) {}
  template <class T>
  requires std::is_arithmetic_v<T> ClArgument(const T& scalar)
      : kind(std::is_floating_point_v<T> ? ClKind::kFloat
             : std::is_signed_v<T>       ? ClKind::kInt
                                         : ClKind::kUnsigned),
        bytes(sizeof(T)),
        value(&scalar) {
    static_assert(sizeof(T) == 4, "pass int, unsigned or float: the kernel's own type");
  }
  template <class T>
  requires std::is_class_v<T> ClArgument(const T& parameters)
      : kind(ClKind::kStruct), bytes(sizeof(T)), value(&parameters) {
    static_assert(std::is_trivially_copyable_v<T>, "a kernel takes a struct of scalars by value");
  }
};

/// The one owner of the driver's state: device, context, an in-order queue, programs and profiling events.
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
  /// Waits for the queue and copies host values to the front of a buffer.
  /// \throw DeviceError when they do not fit
  template <class T>
  void write(ClBuffer<T>& buffer, const std::vector<T>& values) {
    check_fits(values.size(), buffer.size);
    write_bytes(*buffer.memory, values.data(), values.size() * sizeof(T));
  }
  /// Waits for the queue and copies the whole buffer to the host.
  template <class T>
  std::vector<T> download(const ClBuffer<T>& buffer) {
    std::vector<T> values(buffer.size);
    read_bytes(*buffer.memory, values.data(), values.size() * sizeof(T));
    return values;
  }
  /// The same of several buffers, waiting once.
  template <class... T>
  requires(sizeof...(T) > 1) std::tuple<std::vector<T>...> download(const ClBuffer<T>&... buffers) {
    std::tuple<std::vector<T>...> all{std::vector<T>(buffers.size)...};
    std::apply(
        [&](auto&... values) {
          read_all({{buffers.memory.get(), values.data(), values.size() * sizeof(T)}...});
        },
        all);
    return all;
  }
  /// Waits for the queue and lets the host read the whole buffer where it is.
  /// \throw DeviceError when the driver does
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
  /// Copies the whole of a buffer to the front of another one. In the profile it is "copy".
  /// \throw DeviceError when it does not fit
  template <class T>
  void copy(const ClBuffer<T>& from, ClBuffer<T>& to) {
    check_fits(from.size, to.size);
    copy_bytes(*from.memory, *to.memory, from.size * sizeof(T));
  }
  /// Sets every byte of the buffer to that of a repeated 4-byte pattern.
  template <class T>
  void fill(ClBuffer<T>& buffer, std::type_identity_t<T> value) {
    static_assert(sizeof(T) == 4);
    fill_bytes(*buffer.memory, &value, sizeof(T), buffer.size * sizeof(T));
  }

  /// Queues a kernel. A struct of parameters is one that a header in kernels/ shares with the kernel. Programs are
  /// built on first use and kept, see programs_with.
  /// \throw DeviceError naming the kernel, the failing call and its
  /// code in words; the argument whose number or kind is not the kernel's own (kinds where the driver tells them); for
  /// a build the log with the kernel file's lines
  template <class... Args>
  void launch(const ClKernelName& name, const ClRange& range, const Args&... args) {
    launch_with(name, range, std::array<ClArgument, sizeof...(Args)>{ClArgument(args)...});
  }
  void finish();
  /// Builds, or loads from the driver's cache, the program that a kernel is in, before its first launch.
  void prepare(const ClKernelName& name);

  /// Calls `watch` before each program is built or loaded and before the first launch of each kernel, which is when
  /// drivers compile, with the seconds that this has taken so far. Empty: none.
  void watch_compiling(std::function<void(double seconds)> watch);

  /// Launches since the last reset, by kernel, longest first. Waits for the queue.
  std::vector<ClProfileEntry> profile();
  void reset_profile();

  /// Work-items of a group where a kernel has one group per row of a lattice: one that loops over the columns on a CPU,
  /// neighbouring columns side by side on all else. Kernels know it as ROW_ITEMS.
  std::size_t row_items() const;

  /// The largest work-group, at most `wanted`, that this kernel can run with here.
  std::size_t work_group_size(const ClKernelName& name, std::size_t wanted);

 private:
  struct Driver;
  struct Read {
    const ClMemory* from;
    void* to;
    std::size_t bytes;
  };

  static void check_fits(std::size_t values, std::size_t room);
  std::shared_ptr<ClMemory> allocate_bytes(std::size_t bytes, const void* values = nullptr);
  void write_bytes(ClMemory& buffer, const void* data, std::size_t bytes);
  void read_bytes(const ClMemory& buffer, void* data, std::size_t bytes);
  void read_all(std::initializer_list<Read> reads);
  void copy_bytes(const ClMemory& from, ClMemory& to, std::size_t bytes);
  void fill_bytes(ClMemory& buffer, const void* pattern, std::size_t pattern_bytes, std::size_t bytes);
  /// The values can be read when the queue has come by.
  std::shared_ptr<const void> map_bytes(const std::shared_ptr<ClMemory>& buffer, std::size_t bytes);
  template <class... T>
  std::tuple<ClMapping<T>...> map_all(const ClBuffer<T>&... buffers) {
    std::tuple<ClMapping<T>...> all{ClMapping<T>(map_bytes(buffers.memory, buffers.size * sizeof(T)), buffers.size)...};
    finish();
    return all;
  }
  void launch_with(const ClKernelName& name, const ClRange& range, std::span<const ClArgument> arguments);

  ClDeviceInfo info_;
  std::unique_ptr<Driver> driver_;
};

}  // namespace skeletex
