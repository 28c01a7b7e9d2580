// SPDX-License-Identifier: MIT
#include "skeletex/device/context.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numeric>
#include <regex>
#include <vector>

#include "skeletex/device/kernel_source.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// The message of the DeviceError that `action` throws; fails when there is none.
template <class Action>
std::string device_error(const Action& action) {
  try {
    action();
  } catch (const DeviceError& error) {
    return error.what();
  }
  ADD_FAILURE() << "no DeviceError";
  return {};
}

void expect_contains(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << "\"" << part << "\" in:\n" << text;
}

constexpr const char* kScaleKernel =
    "// SPDX-License-Identifier: MIT\n"
    "__kernel void scale(__global float* restrict values, const int count, const float factor) {\n"
    "  const int i = (int)get_global_id(0);\n"
    "  if (i >= count) return;\n"
    "  values[i] *= factor;\n"
    "}\n";

/// Kernel files and a cache of programs in a folder of the test's own.
class Kernels : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "skeletex-context-XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    ::setenv("SKELETEX_KERNEL_DIR", folder_.c_str(), 1);
    write("scale.cl", kScaleKernel);
  }
  void TearDown() override {
    ::unsetenv("SKELETEX_KERNEL_DIR");
    std::error_code ignored;
    std::filesystem::permissions(folder_, std::filesystem::perms::owner_all, ignored);
    std::filesystem::remove_all(folder_, ignored);
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  static std::vector<float> scaled(ClContext& context, const std::string& options = "") {
    auto buffer = context.upload(std::vector<float>{1, 2, 3.5f});
    context.launch({"scale.cl", "scale", options}, 3, buffer, 3, 2.0f);
    return context.download(buffer);
  }
  const std::vector<float> twice_{2, 4, 7};
  std::filesystem::path folder_;
};

}  // namespace

TEST(Context, RefusesAnUnknownDeviceAndListsTheOthers) {
  expect_contains(device_error([] { ClContext context("no such device"); }), list_devices().front().name);
  expect_contains(device_error([] { ClContext context("99"); }), list_devices().front().name);
}

TEST(Context, ChoosesADeviceByNumberTypeAndPartOfItsName) {
  const ClDeviceInfo first = list_devices().front();
  EXPECT_EQ(ClContext("0").device().name, first.name);
  EXPECT_EQ(ClContext(first.type).device().type, first.type);
  std::string part = first.name.substr(first.name.size() / 2);
  for (char& c : part) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  EXPECT_EQ(ClContext(part).device().name, first.name);
}

TEST(Context, UploadsAndDownloadsUnchanged) {
  ClContext context;
  const std::vector<float> values{1, 2, 3.5f};
  EXPECT_EQ(context.download(context.upload(values)), values);
}

TEST(Context, MapsWhatABufferHoldsUntilTheMappingEnds) {
  ClContext context;
  std::vector<int> values(1000);
  for (int i = 0; i < 1000; ++i) values[i] = 7 * i - 3;
  auto buffer = context.upload(values);
  const auto is_equal = [&](const ClMapping<int>& mapping) {
    return mapping.size() == values.size() && std::equal(values.begin(), values.end(), mapping.data());
  };
  ClMapping<int> mapping = context.map(buffer);
  EXPECT_TRUE(is_equal(mapping));
  EXPECT_EQ(mapping[999], 7 * 999 - 3);
  ClMapping<int> other = std::move(mapping);
  EXPECT_TRUE(is_equal(other));
  other = {};
  EXPECT_EQ(other.data(), nullptr);
  // What has been queued before it is done.
  context.fill(buffer, 42);
  values.assign(values.size(), 42);
  mapping = context.map(buffer);
  EXPECT_TRUE(is_equal(mapping));
}

TEST(Context, DownloadsAndMapsSeveralBuffersAfterWhatWasQueued) {
  ClContext context;
  constexpr std::size_t kMany = 1 << 23;  // for which the device takes longer than the host to come by
  auto numbers = context.allocate<int>(kMany);
  const auto values = context.upload(std::vector<float>{1, 2, 3.5f});
  const auto none = context.upload(std::vector<int>{});
  context.fill(numbers, 9);
  const auto [all, few, empty] = context.download(numbers, values, none);
  EXPECT_EQ(all[0], 9);
  EXPECT_EQ(std::count(all.begin(), all.end(), 9), kMany);
  EXPECT_EQ(few, (std::vector<float>{1, 2, 3.5f}));
  EXPECT_TRUE(empty.empty());
  context.fill(numbers, -9);
  const auto [mapped, mapped_few] = context.map(numbers, values);
  EXPECT_EQ(mapped[kMany - 1], -9);
  EXPECT_EQ(std::count(mapped.data(), mapped.data() + mapped.size(), -9), kMany);
  EXPECT_EQ(mapped_few[2], 3.5f);
}

TEST(Context, TakesEmptyVectors) {
  ClContext context;
  const auto buffer = context.upload(std::vector<float>{});
  EXPECT_EQ(buffer.size, 0u);
  EXPECT_TRUE(context.download(buffer).empty());
}

TEST(Context, FillsEveryValue) {
  ClContext context;
  auto buffer = context.allocate<int>(1000);
  context.fill(buffer, -7);
  EXPECT_EQ(context.download(buffer), std::vector<int>(1000, -7));
}

TEST(Context, RefusesABufferThatTheDeviceCannotHoldAndSaysHowMuchItCan) {
  ClContext context;
  const std::size_t too_many = context.device().max_allocation_bytes + 1;
  const std::string message = device_error([&] { context.allocate<char>(too_many); });
  expect_contains(message, std::to_string(context.device().max_allocation_bytes >> 20));
  expect_contains(message, context.device().name);
}

TEST(Context, RefusesToWriteMoreThanABufferHolds) {
  ClContext context;
  auto buffer = context.allocate<float>(3);
  expect_contains(device_error([&] { context.write(buffer, std::vector<float>(4)); }),
                  "4 values do not fit a device buffer of 3");
}

TEST(Context, BuildsEveryKernelFileOfTheLibraryAsItStands) {
  ClContext context;
  for (const EmbeddedKernelFile& file : embedded_kernel_files()) {
    if (!file.name.ends_with(".cl")) continue;
    const std::string text = kernel_source(std::vector<std::string_view>{file.name});
    const std::size_t begin =
        text.find("\n__kernel") == std::string::npos ? text.find("\nkernel") : text.find("\n__kernel");
    ASSERT_NE(begin, std::string::npos) << file.name;
    const std::size_t name = text.find("void ", begin) + 5;
    const std::string kernel = text.substr(name, text.find('(', name) - name);
    EXPECT_GT(context.work_group_size({file.name, kernel}, 64), 0u) << file.name;
  }
}

TEST(Context, KernelsOfTheLibraryTakeOneStructAndAtMostEightBuffers) {
  const std::regex kernel(R"(kernel [A-Z_ ]*void (\w+)\(([^{]*)\) \{)"), buffer(R"(\b(?:__)?(global|constant) )"),
      local(R"(\b(?:__)?local )");
  const auto count_of = [](const std::string& text, const std::regex& what) {
    return std::distance(std::sregex_iterator(text.begin(), text.end(), what), {});
  };
  std::ptrdiff_t kernels = 0;
  for (const EmbeddedKernelFile& file : embedded_kernel_files()) {
    const std::string text(file.text);
    kernels += count_of(text, kernel);
    for (auto match = std::sregex_iterator(text.begin(), text.end(), kernel); match != std::sregex_iterator();
         ++match) {
      const std::string arguments = (*match)[2];
      const std::ptrdiff_t all = 1 + std::count(arguments.begin(), arguments.end(), ','),
                           buffers = count_of(arguments, buffer);
      EXPECT_LE(buffers, 8) << file.name << ": " << (*match)[1];
      EXPECT_LE(all - buffers - count_of(arguments, local), 1) << file.name << ": " << (*match)[1];
    }
  }
  EXPECT_GT(kernels, 60);
}

TEST(Context, BuildsFilesOfOneProgramTogetherAndEachHeaderOnce) {
  const auto files = programs_with("encode.cl").front();
  EXPECT_EQ(files, programs_with("vsm.cl").front());
  EXPECT_EQ(programs_with("diffusion.cl"), std::vector<std::vector<std::string_view>>{{"diffusion.cl"}});
  const std::string text = kernel_source(files);
  for (const std::string_view file : files) expect_contains(text, "#line 1 \"" + std::string(file) + "\"");
  for (const EmbeddedKernelFile& file : embedded_kernel_files())
    for (const auto& program : programs_with(file.name))
      if (file.name != program.back()) {
        EXPECT_EQ(file.text.find("#pragma OPENCL"), std::string_view::npos)
            << file.name << ": the pragma would hold for the files after it";
      }
  const std::string header = "#line 1 \"skeletex_structs.h\"";
  expect_contains(text, header);
  EXPECT_EQ(text.find(header), text.rfind(header));
}

TEST_F(Kernels, TakesAStructOfParameters) {
  write("scale.cl",
        "typedef struct Scale { int count; float factor; } Scale;\n"
        "__kernel void scale(const Scale p, __global float* restrict values) {\n"
        "  const int i = (int)get_global_id(0);\n"
        "  if (i < p.count) values[i] *= p.factor;\n"
        "}\n");
  struct Scale {
    int count;
    float factor;
  };
  ClContext context;
  auto values = context.upload(std::vector<float>{1, 2, 3});
  context.launch({"scale.cl", "scale"}, ClRange(3), Scale{2, 10}, values);
  EXPECT_EQ(context.download(values), (std::vector<float>{10, 20, 3}));
  // Drivers do not tell the size of a struct.
  expect_contains(device_error([&] {
                    context.launch({"scale.cl", "scale"}, ClRange(3), 2, values);
                  }),
                  "argument 0: the kernel takes a struct, not an int");
}

TEST_F(Kernels, ComeFromTheFolderThatTheVariableNames) {
  ClContext context;
  EXPECT_EQ(scaled(context), twice_);
}

TEST_F(Kernels, RunOnGroupsThatDoNotDivideTheRange) {
  ClContext context;
  std::vector<float> values(1000), expected(1000);
  std::iota(values.begin(), values.end(), 0.0f);
  for (std::size_t i = 0; i < values.size(); ++i) expected[i] = 3 * values[i];
  auto buffer = context.upload(values);
  context.launch({"scale.cl", "scale"}, {{1000, 1}, {64, 1}}, buffer, 1000, 3.0f);
  EXPECT_EQ(context.download(buffer), expected);
}

TEST_F(Kernels, DoNothingOnAnEmptyRange) {
  ClContext context;
  auto buffer = context.upload(std::vector<float>{1});
  context.launch({"scale.cl", "scale"}, 0, buffer, 1, 3.0f);
  EXPECT_EQ(context.download(buffer).front(), 1);
}

TEST_F(Kernels, ReceiveOptionsAndLocalMemory) {
  write("sum.cl",
        "__kernel void sum(__global const int* restrict in, __global int* restrict out, __local int* shared) {\n"
        "  const int i = (int)get_local_id(0);\n"
        "  shared[i] = in[i] * FACTOR;\n"
        "  barrier(CLK_LOCAL_MEM_FENCE);\n"
        "  if (i > 0) return;\n"
        "  int total = 0;\n"
        "  for (int j = 0; j < (int)get_local_size(0); ++j) total += shared[j];\n"
        "  out[0] = total;\n"
        "}\n");
  ClContext context;
  const auto in = context.upload(std::vector<int>{1, 2, 3, 4});
  auto out = context.allocate<int>(1);
  context.launch({"sum.cl", "sum", "-DFACTOR=10"}, {{4, 1}, {4, 1}}, in, out, ClLocal{4 * sizeof(int)});
  EXPECT_EQ(context.download(out).front(), 100);
  context.launch({"sum.cl", "sum", "-DFACTOR=-1"}, {{4, 1}, {4, 1}}, in, out, ClLocal{4 * sizeof(int)});
  EXPECT_EQ(context.download(out).front(), -10);
}

TEST_F(Kernels, SayWhichFileAndLineDoesNotCompileAndQuoteIt) {
  write("broken.cl", "// one\n// two\n__kernel void broken(__global float* x) {\n  x[0] = undeclared + 1;\n}\n");
  ClContext context;
  auto buffer = context.allocate<float>(1);
  const std::string message = device_error([&] { context.launch({"broken.cl", "broken"}, 1, buffer); });
  expect_contains(message, "broken.cl:4:");
  expect_contains(message, "x[0] = undeclared + 1;");
  expect_contains(message, context.device().name);
}

TEST_F(Kernels, SayWhichIncludedFileDoesNotCompile) {
  write("part.h", "// a header without a newline at its end\nfloat two(void) { return missing; }");
  write("user.cl", "#include \"part.h\"\n__kernel void use(__global float* x) {\n  x[0] = nothing + two();\n}\n");
  ClContext context;
  auto buffer = context.allocate<float>(1);
  const std::string message = device_error([&] { context.launch({"user.cl", "use"}, 1, buffer); });
  expect_contains(message, "part.h:2:");
  expect_contains(message, "return missing;");
  expect_contains(message, "user.cl:3:");
  expect_contains(message, "x[0] = nothing + two();");
}

TEST_F(Kernels, RefuseAMissingFileAMissingKernelAndAFileThatIncludesItself) {
  write("loop.cl", "#include \"loop.cl\"\n");
  ClContext context;
  auto buffer = context.allocate<float>(1);
  expect_contains(device_error([&] { context.launch({"absent.cl", "scale"}, 1, buffer, 1, 1.0f); }), "absent.cl");
  expect_contains(device_error([&] {
                    context.launch({"scale.cl", "stretch"}, 1, buffer, 1, 1.0f);
                  }),
                  "scale.cl: kernel stretch");
  expect_contains(device_error([&] { context.launch({"loop.cl", "loop"}, 1, buffer); }), "includes itself");
}

TEST_F(Kernels, RefuseArgumentsOfAnotherNumberOrKind) {
  ClContext context;
  auto buffer = context.upload(std::vector<float>{1});
  const ClKernelName scale{"scale.cl", "scale"};
  expect_contains(device_error([&] { context.launch(scale, 1, buffer, 1); }), "scale takes 3 arguments, not 2");
  expect_contains(device_error([&] { context.launch(scale, 1, buffer, 1, 2.0f, 3); }),
                  "scale takes 3 arguments, not 4");
  expect_contains(device_error([&] { context.launch(scale, 1, buffer, 1, 2); }),
                  "argument 2: the kernel takes a float, not an int");
  expect_contains(device_error([&] { context.launch(scale, 1, 1, 1, 2.0f); }),
                  "argument 0: the kernel takes a buffer, not an int");
  expect_contains(device_error([&] { context.launch(scale, 1, buffer, buffer, 2.0f); }),
                  "argument 1: the kernel takes an int, not a buffer");
  EXPECT_EQ(context.download(buffer).front(), 1);
}

TEST_F(Kernels, RefuseAWorkGroupThatTheDeviceCannotRun) {
  ClContext context;
  auto buffer = context.upload(std::vector<float>{1});
  const std::size_t too_large = 2 * context.device().max_work_group_size;
  const std::string message = device_error([&] {
    context.launch({"scale.cl", "scale"}, {{too_large, 1}, {too_large, 1}}, buffer, 1, 2.0f);
  });
  expect_contains(message, "scale.cl: kernel scale cannot run in work-groups of " + std::to_string(too_large));
  EXPECT_LE(context.work_group_size({"scale.cl", "scale"}, too_large), context.device().max_work_group_size);
}

TEST_F(Kernels, AreBuiltAgainWhenSourceOrOptionsChange) {
  write(
      "scale.cl",
      "#include \"by.h\"\n__kernel void scale(__global float* restrict values, const int count, const float factor) {\n"
      "  const int i = (int)get_global_id(0);\n  if (i < count) values[i] = BY(values[i], factor);\n}\n");
  write("by.h", "#ifdef ANOTHER\n#define BY(x, y) ((x) - (y))\n#else\n#define BY(x, y) ((x) * (y))\n#endif\n");
  ClContext context;
  EXPECT_EQ(scaled(context), twice_);
  EXPECT_EQ(scaled(context, "-DANOTHER"), (std::vector<float>{-1, 0, 1.5f}));
  write("by.h", "#define BY(x, y) ((x) + (y))\n");
  ClContext changed;
  EXPECT_EQ(scaled(changed), (std::vector<float>{3, 4, 5.5f}));
}

TEST_F(Kernels, AreTimedByName) {
  ClContext context;
  for (int i = 0; i < 3; ++i) scaled(context);
  const auto profile = context.profile();
  ASSERT_EQ(profile.size(), 1u);
  EXPECT_EQ(profile[0].kernel, "scale.cl:scale");
  EXPECT_EQ(profile[0].launches, 3);
  EXPECT_GT(profile[0].milliseconds, 0);
  context.reset_profile();
  EXPECT_TRUE(context.profile().empty());
}

// Also those that OpenCL has no buffers for, and when the host's memory is gone before the device needs it.
TEST(Context, UploadsAreCopies) {
  ClContext context;
  for (const std::size_t size : {0, 1, 3, 4, 5, 1000}) {
    std::vector<int> values(size);
    std::iota(values.begin(), values.end(), 5);
    const std::vector<int> expected = values;
    const auto buffer = context.upload(values);
    std::fill(values.begin(), values.end(), -1);
    EXPECT_EQ(buffer.size, size);
    EXPECT_EQ(context.download(buffer), expected);
  }
}

}  // namespace skeletex
