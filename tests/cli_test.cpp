// SPDX-License-Identifier: MIT
// The built program as a user drives it: arguments in, exit code, output and files out.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>
#include <set>
#include <thread>

#include "skeletex/device/kernel_source.h"
#include "skeletex/io/gltf/write_gltf.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/memory.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

namespace fs = std::filesystem;

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

struct Outcome {
  int code = -1;
  std::string out, err;
};

/// A folder of its own with y.off and y.skeleton.json, in which the program runs.
class Program : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    std::string pattern = (fs::temp_directory_path() / "skeletex-cli-XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    const Shape shape = y_shape();
    // write_mesh writes PLY and OBJ; input in other formats is io_test's business.
    write_mesh(folder_ / "y.ply", shape.mesh);
    std::ofstream(folder_ / "y.skeleton.json") << skeleton_to_json(shape.skeleton);
    const Outcome encoded = run({"encode", "y.ply", "y.skeleton.json", "-o", "y.skx.exr", "--size", "64"});
    ASSERT_EQ(encoded.code, 0) << encoded.err;
  }
  static void TearDownTestSuite() {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  static void exec(const std::vector<std::string>& arguments) {
    std::vector<char*> argv{const_cast<char*>("skeletex")};
    for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    if (::chdir(folder_.c_str()) == 0) ::execv(SKELETEX_PROGRAM, argv.data());
    ::_exit(127);
  }
  static int code_of(::pid_t child) {
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  static Outcome run(const std::vector<std::string>& arguments, const std::string& out = "stdout.txt") {
    const ::pid_t child = ::fork();
    if (child == 0) {
      const auto redirect = [](const fs::path& path, int to) {
        const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
        ::dup2(file, to);
      };
      redirect(folder_ / out, STDOUT_FILENO);
      redirect(folder_ / "stderr.txt", STDERR_FILENO);
      exec(arguments);
    }
    Outcome outcome{code_of(child), "", text_of(folder_ / "stderr.txt")};
    if (!out.starts_with('/')) outcome.out = text_of(folder_ / out);
    return outcome;
  }
  /// What a terminal would show of both streams.
  static std::string run_on_terminal(const std::vector<std::string>& arguments) {
    int terminal = -1;
    const ::pid_t child = ::forkpty(&terminal, nullptr, nullptr, nullptr);
    if (child == 0) exec(arguments);
    std::string text;
    char buffer[4096];
    for (::ssize_t count; (count = ::read(terminal, buffer, sizeof(buffer))) > 0;)
      text.append(buffer, static_cast<std::size_t>(count));
    ::close(terminal);
    EXPECT_EQ(code_of(child), 0) << text;
    return text;
  }
  static nlohmann::json json_of(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--json", "-"});
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
    return nlohmann::json::parse(outcome.out);
  }
  static std::set<std::string> files() {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_)) names.insert(entry.path().filename().string());
    return names;
  }
  /// Runs what must fail: exit code, one message that names every part, nothing on standard output, no file left
  /// behind.
  static void expect_refused(int code, const std::vector<std::string>& arguments,
                             const std::vector<std::string>& parts) {
    const auto before = files();
    const Outcome outcome = run(arguments);
    std::string line = "skeletex";
    for (const std::string& argument : arguments) line += ' ' + argument;
    EXPECT_EQ(outcome.code, code) << line << '\n' << outcome.err;
    EXPECT_EQ(outcome.out, "") << line;
    for (const std::string& part : parts)
      EXPECT_NE(outcome.err.find(part), std::string::npos) << line << ": \"" << part << "\" in\n" << outcome.err;
    EXPECT_EQ(outcome.err.find("terminate"), std::string::npos) << outcome.err;
    EXPECT_EQ(files(), before) << line;
  }
  static void expect_keys(const nlohmann::json& json, const std::vector<std::string>& keys) {
    for (const std::string& key : keys)
      EXPECT_TRUE(json.contains(key)) << key << " in\n" << json.dump(1).substr(0, 2000);
  }
  static inline fs::path folder_;
};

const std::vector<std::string> kCommands{"encode",  "reconstruct", "filter",  "transfer", "lod",        "metro",
                                         "segment", "validate",    "inspect", "devices",  "skeletonize"};

}  // namespace

TEST_F(Program, HelpsWithEveryCommandOnStandardOutput) {
  const Outcome help = run({"--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_EQ(help.err, "");
  for (const std::string& command : kCommands) {
    EXPECT_NE(help.out.find("\n  " + command), std::string::npos) << command;
    const Outcome own = run({command, "--help"});
    EXPECT_EQ(own.code, 0);
    EXPECT_EQ(own.err, "");
    EXPECT_NE(own.out.find("Example"), std::string::npos) << command;
    EXPECT_NE(own.out.find("--json"), std::string::npos) << command;
  }
}

TEST_F(Program, SaysItsVersion) {
  EXPECT_TRUE(run({"--version"}).out.starts_with("skeletex 0."));
  EXPECT_EQ(run({"-v"}).out, run({"--version"}).out);
}

TEST_F(Program, HelpWithACommandSaysWhatTheCommandsHelpSays) {
  for (const std::string& command : kCommands) {
    const Outcome help = run({"help", command});
    EXPECT_EQ(help.code, 0) << help.err;
    EXPECT_EQ(help.out, run({command, "--help"}).out);
  }
  EXPECT_EQ(run({"help"}).out, run({"--help"}).out);
  expect_refused(2, {"help", "encoed"}, {"unknown command encoed", "did you mean encode?"});
  expect_refused(2, {"manual", "metor"}, {"unknown command metor", "did you mean metro?"});
  expect_refused(2, {"completions", "bsh"}, {"did you mean bash?"});
}

TEST_F(Program, EndsWithTwoOnWrongUsageAndGivesTheNearestName) {
  expect_refused(2, {}, {"skeletex --help"});
  expect_refused(2, {"encoed", "y.ply"}, {"unknown command encoed", "did you mean encode?"});
  expect_refused(2, {"encode", "--meshod", "vsm"},
                 {"unknown option --meshod", "did you mean --method?", "skeletex encode --help"});
  expect_refused(2, {"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--iteration=3"},
                 {"did you mean --iterations?"});
  expect_refused(2, {"metro", "y.ply", "y.ply", "--jsno", "-"}, {"did you mean --json?"});
  expect_refused(2, {"reconstruct", "y.skx.exr", "-o", "y.ply", "-q"}, {"-q"});
  expect_refused(2, {"encode", "y.ply", "y.skeleton.json"}, {"--output"});
  expect_refused(2, {"encode", "-o", "a.skx.exr"}, {"MESH"});
  expect_refused(2, {"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--method", "hybird"},
                 {"hybird", "did you mean hybrid?"});
  expect_refused(2, {"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--bone-method", "trunk"},
                 {"trunk", "BONE=vsm"});
  expect_refused(2, {"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--bone-method", "trunk=vsm"},
                 {"need --method hybrid"});
  expect_refused(2, {"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--iterations", "many"},
                 {"--iterations"});
  expect_refused(2, {"segment", "y.ply", "y.skeleton.json", "-o", "a.obj"}, {".ply"});
  expect_refused(2, {"metro", "y.ply", "y.ply", "--samples", "0"}, {"--samples"});
}

TEST_F(Program, RefusesSizesThatAreNone) {
  for (const char* size : {"", "0", "-5", "3", "12x", "x12", "12x3", "512.5", "1e3", "99999", "512x512x3"})
    expect_refused(2, {"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", std::string("--size=") + size},
                   {"--size"});
  for (const char* size : {"0", "-5", "3", "many"})
    expect_refused(2, {"reconstruct", "y.skx.exr", "-o", "a.ply", std::string("--size=") + size}, {"--size"});
}

TEST_F(Program, SaysIntoHowManyTrianglesItSplitsLargeOnes) {
  const TriangleMesh mesh = read_mesh(folder_ / "y.ply").mesh;
  for (const bool is_large : {false, true}) {
    const Outcome encoded = run({"encode", "y.ply", "y.skeleton.json", "-o", "split.skx.exr", "--size",
                                 is_large ? "1024" : "64", "--json", "split.json"});
    ASSERT_EQ(encoded.code, 0) << encoded.err;
    const nlohmann::json counts = nlohmann::json::parse(text_of(folder_ / "split.json"))["mesh"];
    EXPECT_EQ(counts["triangles"], mesh.triangles.size());
    EXPECT_EQ(counts["split_triangles"].get<std::size_t>() > mesh.triangles.size(), is_large);
    const std::string said = "split into " + counts["split_triangles"].dump();
    EXPECT_EQ(encoded.out.find(said) != std::string::npos, is_large) << encoded.out;
  }
  for (const char* name : {"split.skx.exr", "split.json"}) fs::remove(folder_ / name);
}

TEST_F(Program, EncodesAndReportsWhatTheContractNames) {
  const nlohmann::json json = json_of(
      {"encode", "y.ply", "y.skeleton.json", "-o", "contract.skx.exr", "--method", "hybrid", "--size", "96x64"});
  expect_keys(json, {"mesh", "bones", "atlas", "times_ms", "device"});
  expect_keys(json["mesh"], {"vertices", "triangles", "diagonal", "genus"});
  expect_keys(json["atlas"], {"size", "used_fraction"});
  expect_keys(json["times_ms"], {"half_edge", "segmentation", "parameterization", "encoding", "layers"});
  ASSERT_EQ(json["bones"].size(), 3u);
  double area = 0;
  long texels = 0;
  for (const auto& bone : json["bones"]) {
    expect_keys(bone, {"name", "method", "topology", "area", "vertices", "triangles", "rectangle",
                       "unseen_area_fraction", "flipped_triangles", "sampled_triangle_fraction"});
    ASSERT_EQ(bone["rectangle"].size(), 4u);
    area += bone["area"].get<double>();
    texels += bone["rectangle"][2].get<long>() * bone["rectangle"][3].get<long>();
  }
  const TriangleMesh mesh = read_mesh(folder_ / "y.ply").mesh;
  EXPECT_NEAR(area, surface_area(mesh), 1e-6 * area);
  EXPECT_EQ(json["mesh"]["vertices"], mesh.positions.size());
  EXPECT_EQ(json["mesh"]["genus"], 0);
  EXPECT_EQ(json["atlas"]["size"], nlohmann::json({96, 64}));
  EXPECT_DOUBLE_EQ(json["atlas"]["used_fraction"].get<double>(), static_cast<double>(texels) / (96 * 64));
  fs::remove(folder_ / "contract.skx.exr");
}

TEST_F(Program, WritesHalfFloatsNearTheSurface) {
  std::map<std::string, nlohmann::json> of;
  std::map<std::string, double> means;
  for (const std::string rounding : {"surface", "nearest", "none"}) {
    std::vector<std::string> arguments{"encode", "y.ply", "y.skeleton.json", "-o", "half.skx.exr", "--size", "128"};
    if (rounding != "none") arguments.insert(arguments.end(), {"--half", "--rounding", rounding});
    of[rounding] = json_of(arguments);
    EXPECT_EQ(run({"reconstruct", "half.skx.exr", "-o", "half.ply"}).code, 0);
    means[rounding] = json_of({"metro", "y.ply", "half.ply"})["forward"]["mean"];
    const nlohmann::json file = json_of({"inspect", "half.skx.exr"});
    EXPECT_EQ(file["encoder"].contains("rounded"), rounding == "surface");
  }
  EXPECT_LT(of["surface"]["rounding"]["chosen"].get<double>(),
            0.5 * of["surface"]["rounding"]["nearest"].get<double>());
  EXPECT_FALSE(of["nearest"].contains("rounding"));
  EXPECT_LT(means["none"], means["surface"]);
  EXPECT_LT(means["surface"], means["nearest"]);
  expect_refused(2, {"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--rounding", "nearest"},
                 {"--rounding", "needs --half"});
  // The last one is not rounded: it is made so, alone and with its levels.
  const nlohmann::json later = json_of({"lod", "half.skx.exr", "--size", "128", "--half", "-o", "later.skx.exr"});
  EXPECT_NEAR(later["rounding"][0]["chosen"].get<double>(), of["surface"]["rounding"]["chosen"].get<double>(),
              0.05 * later["rounding"][0]["chosen"].get<double>());
  EXPECT_LT(fs::file_size(folder_ / "later.skx.exr"),
            0.6 * static_cast<double>(fs::file_size(folder_ / "half.skx.exr")));
  EXPECT_EQ(json_of({"lod", "half.skx.exr", "--levels", "--half", "-o", "levels.skx.exr"})["rounding"].size(), 3u);
  EXPECT_EQ(run({"reconstruct", "levels.skx.exr", "--level", "2", "-o", "half.ply"}).code, 0);
  EXPECT_EQ(json_of({"inspect", "half.ply"})["closed_manifold"], true);
  expect_refused(2, {"lod", "half.skx.exr", "--size", "64", "--half", "-o", "no.ply"}, {"no.ply", ".skx.exr"});
  for (const char* name : {"half.skx.exr", "later.skx.exr", "levels.skx.exr", "half.ply"}) fs::remove(folder_ / name);
}

TEST_F(Program, ReconstructsAndReportsWhatTheContractNames) {
  for (const char* size : {"64", "32", "100"}) {
    const nlohmann::json json = json_of({"reconstruct", "y.skx.exr", "-o", "again.ply", "--size", size});
    expect_keys(json, {"vertices", "triangles", "times_ms"});
    const nlohmann::json mesh = json_of({"inspect", "again.ply"});
    EXPECT_EQ(mesh["vertices"], json["vertices"]);
    EXPECT_EQ(mesh["triangles"], json["triangles"]);
    EXPECT_EQ(mesh["closed_manifold"], true);
    EXPECT_EQ(mesh["genus"], 0);
    EXPECT_EQ(mesh["components"], 1);
  }
  const nlohmann::json all = json_of({"reconstruct", "y.skx.exr", "-o", "all.ply", "--all-texels"}),
                       fewer = json_of({"reconstruct", "y.skx.exr", "-o", "again.ply"}),
                       distance = json_of({"metro", "all.ply", "again.ply"});
  EXPECT_LT(fewer["vertices"], all["vertices"]);
  EXPECT_GT(fewer["vertices"].get<int>(), 0.9 * all["vertices"].get<int>());
  EXPECT_LT(json_of({"inspect", "again.ply"})["thin_triangles"].get<double>(),
            0.5 * json_of({"inspect", "all.ply"})["thin_triangles"].get<double>());
  EXPECT_LT(distance["backward"]["max"], 0.005);
  EXPECT_LT(distance["normals"]["forward"]["shading"]["mean"], 0.5);
  fs::remove(folder_ / "all.ply");
  EXPECT_EQ(run({"reconstruct", "y.skx.exr", "-o", "again.obj"}).code, 0);
  EXPECT_TRUE(text_of(folder_ / "again.obj").find("\nf ") != std::string::npos);
  fs::remove(folder_ / "again.ply");
  fs::remove(folder_ / "again.obj");
}

TEST_F(Program, ExportsACoarseMeshWithItsDisplacement) {
  const nlohmann::json fine = json_of({"export", "y.skx.exr", "-o", "rig.glb"}),
                       coarse = json_of(
                           {"export", "y.skx.exr", "-o", "rig.glb", "--lod", "16", "--displacement", "rig.exr"});
  EXPECT_LT(coarse["vertices"].get<int>(), fine["vertices"].get<int>() / 4);
  EXPECT_GT(coarse["displacement"]["width"].get<int>() * coarse["displacement"]["height"].get<int>(), 64 * 32);
  EXPECT_GT(fs::file_size(folder_ / "rig.exr"), 1000u);
  std::set<std::string> pictures;  // maya and arnold take the same
  for (const char* reader : {"blender", "object", "maya", "arnold", "materialx"}) {
    json_of({"export", "y.skx.exr", "-o", "rig.glb", "--lod", "16", "--displacement", "rig.exr", "--displacement-for",
             reader});
    pictures.insert(text_of(folder_ / "rig.exr"));
  }
  EXPECT_EQ(pictures.size(), 4u);
  expect_refused(2, {"export", "y.skx.exr", "-o", "no.glb", "--displacement", "no.exr", "--displacement-for", "max"},
                 {"max", "maya"});
  expect_refused(2, {"export", "y.skx.exr", "-o", "no.glb", "--displacement-for", "maya"}, {"--displacement"});
  expect_refused(2, {"export", "y.skx.exr", "-o", "no.glb", "--displacement", "no.png"}, {"no.png", ".exr"});
  expect_refused(2, {"export", "y.skx.exr", "-o", "no.glb", "--displacement", "y.skx.exr"}, {"y.skx.exr", "MODEL"});
  const std::string by_name = text_of(folder_ / "rig.exr");
  fs::remove(folder_ / "rig.exr");
  json_of({"export", "y.skx.exr", "-o", "rig.glb", "--lod", "16", "--format", "base+vdm", "--displacement-for",
           "materialx"});
  EXPECT_EQ(text_of(folder_ / "rig.exr"), by_name);
  expect_refused(2, {"export", "y.skx.exr", "-o", "y.skx.glb", "--format", "base+vdm"},
                 {"y.skx.exr", "--displacement"});
  expect_refused(2, {"export", "y.skx.exr", "-o", "no.glb", "--format", "base+vdm", "--texture", "64"}, {"--texture"});
  for (const char* name : {"rig.glb", "rig.exr"}) fs::remove(folder_ / name);
}

/// The JSON of a binary glTF file.
nlohmann::json json_of_glb(const std::string& bytes) {
  std::uint32_t size = 0;
  std::memcpy(&size, bytes.data() + 12, 4);
  return nlohmann::json::parse(bytes.substr(20, size));
}

TEST_F(Program, ExportsAndShowsAModelAsItStands) {
  ASSERT_EQ(run({"encode", "y.ply", "y.skeleton.json", "-o", "z.skx.exr", "--size", "64", "--up", "z"}).code, 0);
  const auto turn_of = [&](const std::string& model, const std::vector<std::string>& options) {
    std::vector<std::string> arguments{"export", model, "-o", "rig.glb"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    EXPECT_EQ(run(arguments).code, 0);
    const nlohmann::json armature = json_of_glb(text_of(folder_ / "rig.glb"))["nodes"][1];
    if (!armature.contains("rotation")) return Eigen::Quaterniond::Identity();
    const auto r = armature["rotation"].get<std::vector<double>>();
    return Eigen::Quaterniond(r[3], r[0], r[1], r[2]);
  };
  const Eigen::Quaterniond own = turn_of("z.skx.exr", {});
  EXPECT_LT((own * Vec3::UnitZ() - Vec3::UnitY()).norm(), 1e-6);
  EXPECT_LT((own * -Vec3::UnitY() - Vec3::UnitZ()).norm(), 1e-6);
  EXPECT_LT(own.angularDistance(turn_of("z.skx.exr", {"--up", "z"})), 1e-6);
  // Its bone "left" lies at -x, so that it looks along -z.
  const Eigen::Quaterniond guessed = turn_of("y.skx.exr", {});
  EXPECT_LT((guessed * Vec3::UnitY() - Vec3::UnitY()).norm(), 1e-6);
  EXPECT_LT((guessed * -Vec3::UnitZ() - Vec3::UnitZ()).norm(), 1e-6);
  EXPECT_LT(turn_of("z.skx.exr", {"--up", "y"}).angularDistance(Eigen::Quaterniond::Identity()), 1e-6);
  const auto page_of = [&](const std::vector<std::string>& options) {
    std::vector<std::string> arguments{"view", "z.skx.exr", "-o", "page.html", "--size", "32"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return run(arguments).code == 0 ? text_of(folder_ / "page.html") : "";  // a build without npm makes none
  };
  const std::string page = page_of({});
  if (!page.empty()) {
    EXPECT_EQ(page, page_of({"--up", "z"}));
    EXPECT_NE(page, page_of({"--up", "y"}));
  }
  for (const char* name : {"z.skx.exr", "rig.glb", "page.html"}) fs::remove(folder_ / name);
}

TEST_F(Program, BringsNormalsColoursAndNumbersBack) {
  const TriangleMesh mesh = read_mesh(folder_ / "y.ply").mesh;
  MeshAttributes attributes;
  attributes.numbers.push_back({"quality", {}});
  for (const Vec3& p : mesh.positions) {
    attributes.colours.values.emplace_back(p.x() > 0 ? 1.f : 0.f, 0.5f, 0.25f, 1.f);
    attributes.numbers[0].values.push_back(static_cast<float>(p.z()));
  }
  write_mesh(folder_ / "coloured.ply", mesh, attributes);
  EXPECT_EQ(
      run({"encode", "coloured.ply", "y.skeleton.json", "-o", "coloured.skx.exr", "--size", "64", "--up", "z"}).code,
      0);
  const nlohmann::json header = json_of({"inspect", "coloured.skx.exr"});
  ASSERT_EQ(header["layers"].size(), 3u);
  EXPECT_EQ(header["layers"][2]["channels"], (std::vector<std::string>{"quality.Y"}));
  EXPECT_EQ(header["stance"]["up"], (std::vector<double>{0, 0, 1}));
  EXPECT_EQ(header["stance"]["front"], (std::vector<double>{0, -1, 0}));
  EXPECT_EQ(run({"reconstruct", "coloured.skx.exr", "-o", "back.ply"}).code, 0);
  const MeshFile back = read_mesh(folder_ / "back.ply");
  EXPECT_EQ(back.attributes.normals.values.size(), back.mesh.positions.size());
  EXPECT_EQ(back.attributes.colours.values.size(), back.mesh.positions.size());
  ASSERT_EQ(back.attributes.numbers.size(), 1u);
  EXPECT_EQ(back.attributes.numbers[0].name, "quality");
  EXPECT_EQ(run({"reconstruct", "coloured.skx.exr", "-o", "back.obj", "--texture", "back.png"}).code, 0);
  MeshFile textured = read_mesh(folder_ / "back.obj");
  EXPECT_TRUE(read_materials(folder_ / "back.obj", textured).empty());
  ASSERT_EQ(textured.attributes.materials.size(), 1u);
  EXPECT_FALSE(textured.attributes.materials[0].image.empty());
  EXPECT_EQ(textured.attributes.texture_coordinates.corners.size(), textured.mesh.triangles.size());
  EXPECT_EQ(run({"pack", "coloured.skx.exr", "-o", "coloured.skx", "--quality", "20", "--size", "64"}).code, 0);
  EXPECT_EQ(run({"unpack", "coloured.skx", "-o", "unpacked.skx.exr"}).code, 0);
  const nlohmann::json unpacked = json_of({"inspect", "unpacked.skx.exr"});
  EXPECT_EQ(unpacked["layers"].size(), 2u);  // all but the normals
  EXPECT_EQ(unpacked["stance"], header["stance"]);
  const std::string lost =
      run({"pack", "coloured.skx.exr", "-o", "bare.skx", "--quality", "20", "--size", "64", "--layer-steps", "0"}).err;
  EXPECT_NE(lost.find("leaves out: layer \"colour\", layer \"quality\""), std::string::npos) << lost;
  EXPECT_EQ(run({"filter", "coloured.skx.exr", "smooth", "--layer", "colour", "-o", "soft.skx.exr"}).code, 0);
  expect_refused(1, {"filter", "coloured.skx.exr", "smooth", "--layer", "heat", "-o", "none.skx.exr"},
                 {"heat", "normal, colour, quality"});
  expect_refused(1, {"reconstruct", "y.skx.exr", "-o", "none.obj", "--texture", "none.png"}, {"no colours"});
  EXPECT_EQ(run({"encode", "coloured.ply", "y.skeleton.json", "-o", "bare.skx.exr", "--size", "64", "--no-normals",
                 "--no-colours", "--no-numbers"})
                .code,
            0);
  EXPECT_FALSE(json_of({"inspect", "bare.skx.exr"}).contains("layers"));
}

TEST_F(Program, ReconstructsInPosesAndAnimations) {
  const Skeleton skeleton = read_skeleton(folder_ / "y.skeleton.json");
  const std::string bone = skeleton.bones[1].name;
  const nlohmann::json turned = {{"rotations", {{bone, {{"axis", {1, 0, 0}}, {"degrees", 40}}}}}};
  std::ofstream(folder_ / "pose.json") << turned;
  std::ofstream(folder_ / "animation.json") << nlohmann::json{
      {"frames", {{{"time", 0}, {"pose", nlohmann::json::object()}}, {{"time", 2}, {"pose", turned}}}}};
  ASSERT_EQ(run({"reconstruct", "y.skx.exr", "-o", "bind.ply"}).code, 0);
  ASSERT_EQ(run({"reconstruct", "y.skx.exr", "-o", "posed.ply", "--pose", "pose.json"}).code, 0);
  EXPECT_EQ(json_of({"inspect", "posed.ply"})["closed_manifold"], true);
  const auto positions = [&](const char* name) { return read_mesh(folder_ / name).mesh.positions; };
  const auto difference = [](const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
    double worst = 0;
    for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, (a[i] - b.at(i)).norm());
    return worst;
  };
  EXPECT_GT(difference(positions("posed.ply"), positions("bind.ply")), 0.1);
  for (const auto& [time, same] :
       {std::pair{"0", "bind.ply"}, {"-1", "bind.ply"}, {"2", "posed.ply"}, {"7.5", "posed.ply"}}) {
    const Outcome at = run({"reconstruct", "y.skx.exr", "-o", "again.ply", "--pose", "animation.json", "--time", time});
    ASSERT_EQ(at.code, 0);
    EXPECT_EQ(at.err.find("runs from 0 to 2") != std::string::npos, time[0] == '-' || time[0] == '7') << at.err;
    EXPECT_LT(difference(positions("again.ply"), positions(same)), 1e-5) << time;
  }
  const nlohmann::json polished =
      json_of({"reconstruct", "y.skx.exr", "-o", "again.ply", "--pose", "pose.json", "--polish"});
  EXPECT_EQ(polished.at("polish").at("new_folds"), polished.at("pose").at("new_folds"));
  EXPECT_LE(polished.at("polish").at("new_folds"), polished.at("polish").at("new_folds_before"));
  ASSERT_EQ(run({"render", "y.skx.exr", "-o", "again.png", "--pose", "pose.json", "--polish", "--size", "64x64"}).code,
            0);
  expect_refused(2, {"reconstruct", "y.skx.exr", "-o", "a.ply", "--polish"}, {"--pose"});
  expect_refused(
      2, {"reconstruct", "y.skx.exr", "-o", "a.ply", "--pose", "pose.json", "--polish", "--constant-offset", "0.1"},
      {"--polish"});
  fs::remove(folder_ / "again.png");
  ASSERT_EQ(run({"reconstruct", "y.skx.exr", "-o", "again.ply", "--pose", "pose.json", "--deform", "paper"}).code, 0);
  const auto kept = positions("again.ply");
  EXPECT_GT(difference(kept, positions("posed.ply")), 1e-3);
  ASSERT_EQ(
      run({"reconstruct", "y.skx.exr", "-o", "again.ply", "--pose", "pose.json", "--deform", "paper", "--no-distance"})
          .code,
      0);
  expect_refused(2, {"reconstruct", "y.skx.exr", "-o", "again.ply", "--pose", "pose.json", "--no-distance"},
                 {"--no-distance", "--deform paper"});
  EXPECT_GT(difference(positions("again.ply"), kept), 1e-3);

  expect_refused(2, {"reconstruct", "y.skx.exr", "-o", "a.ply", "--no-distance"}, {"--pose"});
  expect_refused(2, {"reconstruct", "y.skx.exr", "-o", "a.ply", "--time", "1"}, {"--pose"});
  expect_refused(1, {"reconstruct", "y.skx.exr", "-o", "a.ply", "--pose", "y.skeleton.json"}, {"a skeleton"});
  std::ofstream(folder_ / "rig.glb") << "glTF and more";
  expect_refused(1, {"reconstruct", "y.skx.exr", "-o", "a.ply", "--pose", "rig.glb"}, {"skeletex import"});
  fs::remove(folder_ / "rig.glb");
  std::ofstream(folder_ / "pose.json") << nlohmann::json{{"roll", {{bone + "x", 10}}}};
  expect_refused(1, {"reconstruct", "y.skx.exr", "-o", "a.ply", "--pose", "pose.json"},
                 {"pose.json", "no bone \"" + bone + "x\"", "did you mean " + bone + "?"});
  for (const char* name : {"pose.json", "animation.json", "bind.ply", "posed.ply", "again.ply"})
    fs::remove(folder_ / name);
}

TEST_F(Program, ReconstructsAPlaneOfTangentSpace) {
  const Skeleton skeleton = read_skeleton(folder_ / "y.skeleton.json");
  const nlohmann::json whole = json_of({"inspect", "y.skx.exr"});
  const double diagonal = whole["diagonal"].get<double>() * whole["frame"]["scale"].get<double>();
  ASSERT_EQ(run({"reconstruct", "y.skx.exr", "-o", "plane.ply", "--constant-offset", "0.05"}).code, 0);
  for (const Vec3& p : read_mesh(folder_ / "plane.ply").mesh.positions) {
    double nearest = 1e300;
    for (const Bone& bone : skeleton.bones)
      nearest = std::min(nearest,
                         distance_to_bone(p, skeleton.nodes[bone.head].position, skeleton.nodes[bone.tail].position));
    ASSERT_LT(nearest, 0.05 * diagonal * (1 + 1e-4));
  }
  const std::string bone = skeleton.bones[0].name;
  ASSERT_EQ(run({"reconstruct", "y.skx.exr", "-o", "one.ply", "--constant-offset", "0.05", "--bones", bone}).code, 0);
  for (const Vec3& p : read_mesh(folder_ / "one.ply").mesh.positions)
    ASSERT_NEAR(distance_to_bone(p, skeleton.nodes[skeleton.bones[0].head].position,
                                 skeleton.nodes[skeleton.bones[0].tail].position),
                0.05 * diagonal, 1e-4 * diagonal);
  expect_refused(1, {"reconstruct", "y.skx.exr", "-o", "a.ply", "--constant-offset", "0.05", "--bones", "nobody"},
                 {"no bone \"nobody\""});
  expect_refused(2, {"reconstruct", "y.skx.exr", "-o", "a.ply", "--bones", bone}, {"--constant-offset"});
  expect_refused(2, {"reconstruct", "y.skx.exr", "-o", "a.ply", "--constant-offset", "0"}, {"--constant-offset"});
  for (const char* name : {"plane.ply", "one.ply"}) fs::remove(folder_ / name);
}

TEST_F(Program, FiltersModelsAndReportsWhatTheContractNames) {
  for (const std::string filter : {"smooth", "enhance", "noise"}) {
    const Outcome outcome = run({"filter", "y.skx.exr", filter, "-o", filter + ".skx.exr", "--bones",
                                 y_shape().skeleton.bones[0].name, "--json", "-"});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const nlohmann::json json = nlohmann::json::parse(outcome.out);
    EXPECT_EQ(json.at("filter"), filter);
    EXPECT_EQ(json.at("output").at("kind"), "model");
    EXPECT_GT(json.at("moved").at("max").get<double>(), 0);
    EXPECT_GT(json.at("volume").at("after").get<double>(), 0);
    EXPECT_GT(json.at("solver").at("steps").get<int>(), 0);
    EXPECT_EQ(run({"inspect", filter + ".skx.exr"}).code, 0);
  }
  ASSERT_EQ(run({"filter", "y.skx.exr", "smooth", "-o", "smooth.ply", "--keep-volume", "--scale", "0.05"}).code, 0);
  EXPECT_TRUE(
      nlohmann::json::parse(run({"inspect", "smooth.ply", "--json", "-"}).out).at("closed_manifold").get<bool>());
  ASSERT_EQ(run({"filter", "y.skx.exr", "curvature", "-o", "curvature.ply"}).code, 0);
  EXPECT_NE(text_of(folder_ / "curvature.ply").find("property float nx"), std::string::npos);
  EXPECT_NE(text_of(folder_ / "curvature.ply").find("property float mean_curvature"), std::string::npos);
}

TEST_F(Program, RefusesOptionsThatAreAnotherFiltersAndBonesThatAreNone) {
  expect_refused(2, {"filter", "y.skx.exr", "smooth", "-o", "no.ply", "--gain", "2"},
                 {"--gain is for enhance, not for smooth"});
  expect_refused(2, {"filter", "y.skx.exr", "smoth", "-o", "no.ply"}, {"smoth", "smooth"});
  expect_refused(1, {"filter", "y.skx.exr", "smooth", "-o", "no.ply", "--bones", "nose"}, {"nose"});
  expect_refused(2, {"filter", "y.skx.exr", "curvature", "-o", "no.skx.exr"}, {".ply"});
  expect_refused(2, {"filter", "y.skx.exr", "noise", "-o", "no.off"}, {".off", ".ply"});
}

TEST_F(Program, TransfersBonesAndSaysHow) {
  const std::string a = y_shape().skeleton.bones[0].name, b = y_shape().skeleton.bones[1].name;
  for (const std::string blend : {"cosine", "linear", "none"}) {
    const Outcome outcome = run({"transfer", "y.skx.exr", "y.skx.exr", "--bones", a + "=" + b, "--blend", blend,
                                 "--width", "6px", "-o", "t.skx.exr", "--json", "-"});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const nlohmann::json json = nlohmann::json::parse(outcome.out), &part = json.at("bones").at(0);
    EXPECT_EQ(part.at("source"), a);
    EXPECT_EQ(part.at("target"), b);
    EXPECT_GT(part.at("scale").get<double>(), 0);
    EXPECT_GT(part.at("length_scale").get<double>(), 0);
    EXPECT_GE(json.at("folded_edges").get<int>(), 0);
    EXPECT_GE(json.at("folded_edges_of_target").get<int>(), 0);
    EXPECT_EQ(run({"inspect", "t.skx.exr"}).code, 0);
  }
  const Outcome outcome = run({"transfer", "y.skx.exr", "y.skx.exr", "--bones", a + "=" + b, "--scale", "1.5", "--keep",
                               "0.1", "--skip", "0.2", "--limb", "--mirror", "-o", "t.ply", "--json", "-"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const nlohmann::json part = nlohmann::json::parse(outcome.out).at("bones").at(0);
  EXPECT_NEAR(part.at("scale").get<double>(), 1.5, 1e-6);
  EXPECT_NEAR(part.at("kept").get<double>(), 0.1, 1e-6);
  EXPECT_NEAR(part.at("skipped").get<double>(), 0.2, 1e-6);
  EXPECT_TRUE(nlohmann::json::parse(run({"inspect", "t.ply", "--json", "-"}).out).at("closed_manifold").get<bool>());
}

TEST_F(Program, RefusesTransfersThatCannotBe) {
  const std::string bone = y_shape().skeleton.bones[0].name;
  const auto refused = [&](int code, const std::vector<std::string>& more, const std::vector<std::string>& words) {
    std::vector<std::string> arguments{"transfer", "y.skx.exr", "y.skx.exr", "-o", "no.skx.exr"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    expect_refused(code, arguments, words);
  };
  const std::string same = bone + "=" + bone;
  refused(2, {}, {"--bones"});
  refused(2, {"--bones", same, "--blend", "cosin"}, {"cosin", "cosine"});
  refused(2, {"--bones", same, "--width", "2"}, {"--width", "12px"});
  refused(2, {"--bones", same, "--width", "0px"}, {"--width"});
  refused(2, {"--bones", same, "--scale", "0"}, {"--scale", "girth"});
  refused(2, {"--bones", same, "--scale", "big"}, {"--scale", "big"});
  refused(2, {"--bones", same, "--keep", "1"}, {"--keep", "0.9"});
  refused(2, {"--bones", same, "--skip", "-1"}, {"--skip"});
  refused(1, {"--bones", "nose=" + bone}, {"nose"});
  refused(1, {"--bones", same + "," + same}, {bone, "twice"});
  EXPECT_FALSE(fs::exists(folder_ / "no.skx.exr"));
}

TEST_F(Program, WritesSmallerModelsAndChainsOfLevels) {
  ASSERT_EQ(run({"lod", "y.skx.exr", "--size", "32", "-o", "y32.skx.exr"}).code, 0);
  EXPECT_EQ(json_of({"inspect", "y32.skx.exr"})["texture"]["width"], 32);
  const nlohmann::json json = json_of({"lod", "y.skx.exr", "--levels", "--smallest", "16", "-o", "levels.skx.exr"});
  EXPECT_EQ(json["levels"], nlohmann::json::parse("[[64,64],[32,32],[16,16]]"));
  EXPECT_EQ(json_of({"inspect", "levels.skx.exr"}), json_of({"inspect", "y.skx.exr"})) << "level 0 is the model";
  EXPECT_NE(run({"inspect", "levels.skx.exr"}).out.find("level 2: 16 x 16"), std::string::npos);
  ASSERT_EQ(run({"reconstruct", "levels.skx.exr", "-o", "a.ply"}).code, 0);
  ASSERT_EQ(run({"reconstruct", "y.skx.exr", "-o", "b.ply"}).code, 0);
  EXPECT_EQ(text_of(folder_ / "a.ply"), text_of(folder_ / "b.ply"));
  ASSERT_EQ(run({"reconstruct", "levels.skx.exr", "--level", "1", "-o", "a.ply"}).code, 0);
  ASSERT_EQ(run({"reconstruct", "y32.skx.exr", "-o", "b.ply"}).code, 0);
  EXPECT_EQ(text_of(folder_ / "a.ply"), text_of(folder_ / "b.ply"));
  const std::string bytes = text_of(folder_ / "levels.skx.exr");
  ASSERT_EQ(run({"lod", "y.skx.exr", "--levels", "--smallest", "16", "-o", "levels.skx.exr"}).code, 0);
  EXPECT_EQ(text_of(folder_ / "levels.skx.exr"), bytes);

  std::ofstream(folder_ / "cut.skx.exr", std::ios::binary) << bytes.substr(0, bytes.size() - 100);
  expect_refused(1, {"reconstruct", "cut.skx.exr", "-o", "no.ply"}, {"cut.skx.exr", "ends early"});
  expect_refused(1, {"reconstruct", "levels.skx.exr", "--level", "3", "-o", "no.ply"}, {"no level 3", "levels 0 to 2"});
  expect_refused(1, {"reconstruct", "y.skx.exr", "--level", "1", "-o", "no.ply"}, {"no level 1", "level 0 alone"});
  ASSERT_EQ(run({"lod", "y.skx.exr", "--size", "32", "-o", "y32.SKX.EXR"}).code, 0);
  fs::remove(folder_ / "y32.SKX.EXR");
  expect_refused(2, {"lod", "y.skx.exr", "--levels", "-o", "no.ply"}, {".skx.exr"});
  expect_refused(2, {"lod", "y.skx.exr", "-o", "no.ply"}, {"--size", "--levels"});
}

TEST_F(Program, MeasuresAndReportsWhatTheContractNames) {
  ASSERT_EQ(run({"reconstruct", "y.skx.exr", "-o", "again.ply"}).code, 0);
  const nlohmann::json json =
      json_of({"metro", "y.ply", "again.ply", "--samples", "20000", "--csv", "d.csv", "--ply", "d.ply"});
  expect_keys(json, {"diagonal", "forward", "backward", "vertex", "normals", "seconds"});
  for (const char* direction : {"forward", "backward"})
    for (const char* kind : {"surface", "shading"})
      expect_keys(json["normals"][direction][kind], {"mean", "p95", "p99"});
  for (const char* part : {"forward", "backward", "vertex"}) {
    expect_keys(json[part], {"mean", "std", "rms", "max"});
    const double mean = json[part]["mean"], rms = json[part]["rms"], max = json[part]["max"], std = json[part]["std"];
    EXPECT_GT(mean, 0);
    EXPECT_LE(mean, rms);
    EXPECT_LE(rms, max);
    EXPECT_LT(max, 0.1);
    EXPECT_NEAR(rms * rms, mean * mean + std * std, 1e-6 * rms * rms);
  }
  const std::string csv = text_of(folder_ / "d.csv");
  const auto vertices = read_mesh(folder_ / "y.ply").mesh.positions.size();
  EXPECT_EQ(static_cast<std::size_t>(std::count(csv.begin(), csv.end(), '\n')), vertices + 1);
  EXPECT_TRUE(csv.starts_with("vertex,x,y,z,distance\n0,"));
  const std::string ply = text_of(folder_ / "d.ply");
  EXPECT_NE(ply.substr(0, 1000).find("property float distance"), std::string::npos);
  EXPECT_NE(ply.substr(0, 1000).find("property uchar red"), std::string::npos);
  for (const char* name : {"again.ply", "d.csv", "d.ply"}) fs::remove(folder_ / name);
}

TEST_F(Program, MeasuresModelsAsTheMeshesThatTheyReconstructTo) {
  ASSERT_EQ(run({"reconstruct", "y.skx.exr", "-o", "large.ply", "--size", "96", "--all-texels"}).code, 0);
  ASSERT_EQ(run({"pack", "y.skx.exr", "-o", "y.skx", "--size", "64", "--quality", "20"}).code, 0);
  const nlohmann::json mesh = json_of({"metro", "y.ply", "large.ply", "--samples", "20000"}),
                       model = json_of({"metro", "y.ply", "y.skx.exr", "--size", "96", "--samples", "20000"}),
                       compact = json_of({"metro", "y.skx.exr", "y.skx", "--samples", "20000"});
  for (const char* part : {"forward", "backward", "vertex"})
    EXPECT_NEAR(model[part]["mean"].get<double>(), mesh[part]["mean"].get<double>(),
                1e-3 * mesh[part]["mean"].get<double>());
  EXPECT_NEAR(model["normals"]["forward"]["shading"]["mean"].get<double>(),
              mesh["normals"]["forward"]["shading"]["mean"].get<double>(), 0.01);
  EXPECT_GT(compact["forward"]["mean"].get<double>(), 0);
  EXPECT_LT(compact["forward"]["mean"].get<double>(), 1e-3);
  expect_refused(2, {"metro", "y.ply", "y.ply", "--size", "64"}, {"--size", "neither A nor B"});
  for (const char* name : {"large.ply", "y.skx"}) fs::remove(folder_ / name);
}

TEST_F(Program, FindsNoDistanceFromAMeshToItself) {
  const nlohmann::json json = json_of({"metro", "y.ply", "y.ply", "--samples", "5000"});
  EXPECT_LT(json["forward"]["max"].get<double>(), 1e-6);
  EXPECT_LT(json["vertex"]["max"].get<double>(), 1e-6);
}

TEST_F(Program, SaysWhichMeshIsInsideOutWhereNormalsPointOppositeWays) {
  TriangleMesh turned = read_mesh(folder_ / "y.ply").mesh;
  for (Triangle& t : turned.triangles) std::swap(t[1], t[2]);
  write_mesh(folder_ / "turned.ply", turned);
  EXPECT_NE(run({"metro", "y.ply", "turned.ply", "--samples", "5000"}).err.find("B is inside out"), std::string::npos);
  EXPECT_NE(run({"metro", "turned.ply", "y.ply", "--samples", "5000"}).err.find("A is inside out"), std::string::npos);
  EXPECT_EQ(run({"metro", "y.ply", "y.ply", "--samples", "5000"}).err, "");
  fs::remove(folder_ / "turned.ply");
}

TEST_F(Program, ColoursEachBonesSegmentAndSaysWhichColourIsWhose) {
  const nlohmann::json json = json_of({"segment", "y.ply", "y.skeleton.json", "-o", "s.ply"});
  std::set<std::string> colours;
  for (const auto& bone : json["bones"]) colours.insert(bone["colour"].get<std::string>());
  EXPECT_EQ(colours.size(), 3u);
  EXPECT_NE(text_of(folder_ / "s.ply").substr(0, 1000).find("property uchar red"), std::string::npos);
  EXPECT_EQ(read_mesh(folder_ / "s.ply").mesh.triangles.size(), json["triangles"].get<std::size_t>());
  fs::remove(folder_ / "s.ply");
}

TEST_F(Program, ValidatesWithExitCodesAndFindings) {
  const nlohmann::json good = json_of({"validate", "y.ply", "y.skeleton.json"});
  EXPECT_EQ(good["valid"], true);
  TriangleMesh open = read_mesh(folder_ / "y.ply").mesh;
  open.triangles.pop_back();
  write_mesh(folder_ / "open.ply", open);
  const Outcome bad = run({"validate", "open.ply", "y.skeleton.json", "--json", "-"});
  EXPECT_EQ(bad.code, 1);
  const auto json = nlohmann::json::parse(bad.out);
  EXPECT_EQ(json["valid"], false);
  ASSERT_FALSE(json["findings"].empty());
  for (const auto& finding : json["findings"]) expect_keys(finding, {"severity", "rule", "message", "remedy"});
  expect_refused(1, {"encode", "open.ply", "y.skeleton.json", "-o", "a.skx.exr"}, {"error:", "remedy:"});
  const nlohmann::json mesh_alone = json_of({"validate", "y.ply"});
  EXPECT_EQ(mesh_alone["valid"], true);
  EXPECT_FALSE(mesh_alone.contains("bones"));
  EXPECT_EQ(run({"validate", "open.ply"}).code, 1);
  expect_refused(2, {"validate", "y.ply", "--repair", "fixed.skeleton.json"}, {"SKELETON"});
  fs::remove(folder_ / "open.ply");
}

TEST_F(Program, MakesSkeletonsAndEncodesMeshesWithoutOne) {
  const nlohmann::json json = json_of({"skeletonize", "y.ply", "-o", "made.skeleton.json"});
  expect_keys(json, {"bones", "nodes", "genus", "limbs", "chosen", "candidates", "seconds"});
  const Skeleton made = read_skeleton(folder_ / "made.skeleton.json");
  EXPECT_EQ(made.bones.size(), json["bones"].get<std::size_t>());
  EXPECT_EQ(json_of({"validate", "y.ply", "made.skeleton.json"})["valid"], true);
  const Outcome encoded = run({"encode", "y.ply", "-o", "made.skx.exr", "--size", "64"});
  EXPECT_EQ(encoded.code, 0) << encoded.err;
  EXPECT_NE(encoded.err.find("no skeleton was given"), std::string::npos) << encoded.err;
  EXPECT_EQ(json_of({"inspect", "made.skx.exr"})["skeleton"]["bones"].size(), made.bones.size());
  for (const char* file : {"made.skeleton.json", "made.skx.exr"}) fs::remove(folder_ / file);
}

TEST_F(Program, RepairsASkeletonAndSuggestsTheSameAsData) {
  Skeleton skeleton = read_skeleton(folder_ / "y.skeleton.json");
  const auto at_nodes = bones_at_nodes(skeleton);
  int end = 0;
  while (at_nodes[end].size() > 1) ++end;
  skeleton.nodes[end].position *= 3;  // outside
  std::ofstream(folder_ / "wrong.skeleton.json") << skeleton_to_json(skeleton);
  const Outcome outcome =
      run({"validate", "y.ply", "wrong.skeleton.json", "--repair", "fixed.skeleton.json", "--json", "-"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json["valid"], false);
  EXPECT_FALSE(json["changes"].empty());
  EXPECT_EQ(json_of({"validate", "y.ply", "fixed.skeleton.json"})["valid"], true);
  // The suggestion of the finding about the node, applied literally, takes the finding away.
  bool is_told = false;
  for (const auto& finding : json["findings"]) {
    if (finding["rule"] != "node-inside") continue;
    EXPECT_EQ(finding["node"], skeleton.nodes[end].name);
    const auto& moved = finding.at("suggestion").at("nodes").at(0);
    EXPECT_EQ(moved["node"], skeleton.nodes[end].name);
    for (int d = 0; d < 3; ++d) skeleton.nodes[end].position[d] = moved["position"][d];
    is_told = true;
  }
  EXPECT_TRUE(is_told) << outcome.out;
  std::ofstream(folder_ / "wrong.skeleton.json") << skeleton_to_json(skeleton);
  const Outcome after = run({"validate", "y.ply", "wrong.skeleton.json", "--json", "-"});
  EXPECT_EQ(after.out.find("node-inside"), std::string::npos) << after.out;
  for (const char* file : {"wrong.skeleton.json", "fixed.skeleton.json"}) fs::remove(folder_ / file);
}

TEST_F(Program, InspectsAModelForPeopleAndForPrograms) {
  const Outcome people = run({"inspect", "y.skx.exr"});
  EXPECT_EQ(people.code, 0) << people.err;
  for (const char* part : {"64 x 64 texels", "3 bones", "genus 0", "disk", "pole"})
    EXPECT_NE(people.out.find(part), std::string::npos) << part << people.out;
  const nlohmann::json json = json_of({"inspect", "y.skx.exr"});
  EXPECT_EQ(json["skeleton"]["bones"].size(), 3u);
  EXPECT_EQ(json["patches"].size(), 3u);
}

TEST_F(Program, ListsTheDevices) {
  const nlohmann::json json = json_of({"devices"});
  ASSERT_FALSE(json["devices"].empty());
  const std::string name = json["devices"][0]["name"];
  EXPECT_NE(run({"devices"}).out.find(name), std::string::npos);
  expect_refused(1, {"metro", "y.ply", "y.ply", "--device", "no such device"}, {"no such device", name});
}

TEST_F(Program, GivesTheSameBytesTwice) {
  ASSERT_EQ(run({"encode", "y.ply", "y.skeleton.json", "-o", "twin.skx.exr", "--size", "64"}).code, 0);
  EXPECT_TRUE(text_of(folder_ / "twin.skx.exr") == text_of(folder_ / "y.skx.exr"));
  fs::remove(folder_ / "twin.skx.exr");
}

TEST_F(Program, RunsWithAnyNumberOfDeviceThreads) {
  const char* const variable = "POCL_MAX_PTHREAD_COUNT";
  for (const unsigned threads : {1u, std::thread::hardware_concurrency() + 3}) {
    ::setenv(variable, std::to_string(threads).c_str(), 1);
    const Outcome outcome = run({"encode", "y.ply", "y.skeleton.json", "-o", "twin.skx.exr", "--size", "64"});
    ::unsetenv(variable);
    EXPECT_EQ(outcome.code, 0) << threads << ": " << outcome.err;
    EXPECT_TRUE(text_of(folder_ / "twin.skx.exr") == text_of(folder_ / "y.skx.exr")) << threads;
    fs::remove(folder_ / "twin.skx.exr");
  }
}

/// The driver's own files of compiled kernels and programs (PoCL), empty at first.
class KernelCache {
 public:
  explicit KernelCache(const fs::path& folder) : folder_(folder) {
    if (const char* own = std::getenv("POCL_CACHE_DIR")) before_ = own;
    fs::remove_all(folder);
    fs::create_directory(folder);
    ::setenv("POCL_CACHE_DIR", folder.c_str(), 1);
  }
  ~KernelCache() { before_ ? ::setenv("POCL_CACHE_DIR", before_->c_str(), 1) : ::unsetenv("POCL_CACHE_DIR"); }
  KernelCache(const KernelCache&) = delete;
  KernelCache& operator=(const KernelCache&) = delete;

  std::map<fs::path, fs::file_time_type> files() const {
    std::map<fs::path, fs::file_time_type> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_))
      if (entry.path().extension() == ".so" || entry.path().extension() == ".bc")
        files[entry.path()] = entry.last_write_time();
    return files;
  }

 private:
  fs::path folder_;
  std::optional<std::string> before_;
};

TEST_F(Program, CompilesEachKernelOnceAndNothingInASecondProcess) {
  const KernelCache cache(folder_ / "kernels");
  const auto encode = [] {
    return run({"encode", "y.ply", "y.skeleton.json", "-o", "c.skx.exr", "--size", "64", "--snap", "--fit"}).code;
  };
  EXPECT_EQ(encode(), 0);
  const auto first = cache.files();
  EXPECT_EQ(encode(), 0);
  if (first.empty()) GTEST_SKIP() << "the device is none of PoCL's";
  EXPECT_EQ(first, cache.files());
  // Folders: a program, a kernel, its versions by size of work-groups.
  std::set<fs::path> programs, kernels;
  for (const auto& [path, time] : first) {
    if (path.extension() == ".bc")
      EXPECT_TRUE(programs.insert(path.parent_path()).second) << path;
    else
      EXPECT_TRUE(kernels.insert(path.parent_path().parent_path()).second) << path;
  }
  EXPECT_LE(programs.size(), 3u);  // encoding, the decoder's triangles, and nearest points
  EXPECT_GT(kernels.size(), 20u);
}

TEST_F(Program, CompilesAllKernelsAhead) {
  const KernelCache cache(folder_ / "kernels");
  std::set<std::string> launched;
  const nlohmann::json compiled = json_of({"devices", "--compile"});
  for (const auto& kernel : compiled["kernels"]) launched.insert(kernel["kernel"]);
  // Some kernels are for meshes that are larger, or worse, than the one that is run.
  static const std::regex pattern("kernel [A-Z_ ]*void (\\w+)");
  std::size_t all = 0, found = 0;
  for (const EmbeddedKernelFile& file : embedded_kernel_files()) {
    const std::string text(file.text);
    std::size_t of_file = 0, found_of_file = 0;
    for (std::sregex_iterator i(text.begin(), text.end(), pattern), end; i != end; ++i, ++of_file)
      found_of_file += launched.count(std::string(file.name) + ':' + i->str(1));
    EXPECT_TRUE(of_file == 0 || found_of_file > 0) << file.name;
    all += of_file, found += found_of_file;
  }
  EXPECT_GT(found, all * 9 / 10) << "of " << all;
  const std::size_t ahead = cache.files().size();
  if (ahead == 0) GTEST_SKIP() << "the device is none of PoCL's";
  EXPECT_EQ(run({"encode", "y.ply", "y.skeleton.json", "-o", "c.skx.exr", "--size", "64"}).code, 0);
  EXPECT_EQ(run({"reconstruct", "c.skx.exr", "-o", "c.ply"}).code, 0);
  EXPECT_LE(cache.files().size(), ahead + 2);
  expect_refused(2, {"devices", "--device", "cpu"}, {"--compile"});
}

TEST_F(Program, TellsWhatWasDoneToEachBoneOnRequest) {
  const std::vector<std::string> arguments{"encode", "y.ply", "y.skeleton.json", "-o", "v.skx.exr", "--size", "64"};
  const std::string plain = run(arguments).out;
  EXPECT_EQ(plain.find("columns x rows"), std::string::npos) << plain;
  EXPECT_NE(plain.find("64 x 64 texels"), std::string::npos) << plain;
  std::vector<std::string> verbose = arguments;
  verbose.push_back("--verbose");
  EXPECT_NE(run(verbose).out.find("columns x rows"), std::string::npos);
}

TEST_F(Program, TakesThePapersRecipeAndItsPartsAlike) {
  ASSERT_EQ(run({"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--size", "64", "--paper-recipe"}).code, 0);
  ASSERT_EQ(run({"encode", "y.ply", "y.skeleton.json", "-o", "b.skx.exr", "--size", "64", "--rows", "uniform",
                 "--alpha", "0", "--iterations", "1", "--share", "triangles", "--no-unfold", "--no-prefilter"})
                .code,
            0);
  EXPECT_TRUE(text_of(folder_ / "a.skx.exr") == text_of(folder_ / "b.skx.exr"));
  EXPECT_FALSE(text_of(folder_ / "a.skx.exr") == text_of(folder_ / "y.skx.exr"));
  fs::remove(folder_ / "a.skx.exr");
  fs::remove(folder_ / "b.skx.exr");
}

TEST_F(Program, SnapsTexelsAndSaysHowMany) {
  const nlohmann::json snapped =
      json_of({"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--size", "64", "--snap", "--no-fit"});
  EXPECT_FALSE(snapped.contains("fit"));
  EXPECT_GT(snapped["snap"]["snapped_vertices"], 0);
  EXPECT_LE(snapped["snap"]["snapped_vertices"], snapped["snap"]["vertices"]);
  EXPECT_TRUE(json_of({"inspect", "a.skx.exr"})["sampling"]["snapped"]);
  const nlohmann::json fitted =
      json_of({"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--size", "64", "--fit"});
  EXPECT_GE(fitted["fit"]["residuals"].size(), 2u);
  EXPECT_LE(fitted["inverted_triangles"]["lattice"], 64 * 64);
  const nlohmann::json header = json_of({"inspect", "a.skx.exr"});
  EXPECT_EQ(header["diagonals"], "smooth");
  EXPECT_EQ(header["encoder"]["fitted"]["residuals"], fitted["fit"]["residuals"]);
  const nlohmann::json chosen = json_of({"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--size", "64"});
  EXPECT_TRUE(chosen.contains("fit"));
  const nlohmann::json plain =
      json_of({"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--size", "64", "--no-snap", "--no-fit"});
  EXPECT_FALSE(plain.contains("snap") || plain.contains("fit"));
  EXPECT_FALSE(json_of({"inspect", "a.skx.exr"}).contains("diagonals"));
  EXPECT_EQ(json_of({"inspect", "y.ply", "--self-intersections"})["self_intersections"], 0);
  expect_refused(1, {"inspect", "y.skx.exr", "--self-intersections"}, {"for meshes"});
  fs::remove(folder_ / "a.skx.exr");
}

TEST_F(Program, NamesTheNearestBone) {
  const std::string name = read_skeleton(folder_ / "y.skeleton.json").bones[0].name;
  expect_refused(
      1,
      {"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--method", "hybrid", "--bone-method", name + "x=vsm"},
      {"no bone \"" + name + "x\"", "did you mean " + name});
}

TEST_F(Program, DrawsModelsAndMeshesInEveryMode) {
  std::ofstream(folder_ / "y.json")
      << R"({"name": "y", "mesh": "y.ply", "skeleton": "y.skeleton.json", "credits": "", "view": {"azimuth": 60}})";
  const std::vector<std::vector<std::string>> drawn{
      {"y.skx.exr"},
      {"y.skx.exr", "--mode", "segments", "--show-skeleton"},
      {"y.skx.exr", "--mode", "checker", "--lattice", "32", "--flat"},
      {"y.skx.exr", "--mode", "map"},
      {"y.skx.exr", "--mode", "layout"},
      {"y.ply", "--mode", "normals", "--background", "transparent"},
      {"y.ply", "--mode", "error", "--against", "y.ply", "--wireframe", "--views", "2"},
      {"y.json", "--mode", "segments"}};
  for (std::vector<std::string> arguments : drawn) {
    arguments.insert(arguments.begin(), "render");
    for (const char* more : {"-o", "a.png", "--size", "64x48", "--samples", "1", "--json", "a.json"})
      arguments.push_back(more);
    const Outcome outcome = run(arguments);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_TRUE(text_of(folder_ / "a.png").starts_with("\x89PNG")) << arguments[1];
    EXPECT_EQ(nlohmann::json::parse(text_of(folder_ / "a.json")).at("picture"), "a.png");
    fs::remove(folder_ / "a.png");
  }
  expect_refused(2, {"render", "y.ply", "-o", "a.jpg"}, {".png"});
  expect_refused(2, {"render", "y.ply", "-o", "a.png", "--mode", "map"}, {"a mesh has none"});
  expect_refused(2, {"render", "y.ply", "-o", "a.png", "--mode", "segments"}, {"--skeleton"});
  expect_refused(2, {"render", "y.ply", "-o", "a.png", "--mode", "error"}, {"--against"});
  expect_refused(2, {"render", "y.ply", "-o", "a.png", "--mode", "shadde"}, {"did you mean shaded?"});
  expect_refused(2, {"render", "y.ply", "-o", "a.png", "--size", "64x"}, {"1200x900"});
  expect_refused(2, {"render", "y.ply", "-o", "a.png", "--size", "8"}, {"16 to 8192 pixels"});
  expect_refused(2, {"render", "y.ply", "-o", "a.png", "--background", "whitish"}, {"#rrggbb"});
  expect_refused(2, {"render", "y.ply", "-o", "a.png", "--up", "0,1"}, {"0,1,0"});
  expect_refused(2, {"render", "y.ply", "-o", "a.png", "--up", "1e300,1e300,0"}, {"--up"});
  expect_refused(1, {"render", "y.ply", "-o", "no/a.png"}, {"no/a.png"});
  std::ofstream(folder_ / "view.json") << R"({"azimut": 3})";
  expect_refused(1, {"render", "y.ply", "-o", "a.png", "--camera", "view.json"}, {"view.json", "azimut"});
  for (const char* name : {"y.json", "a.json", "view.json"}) fs::remove(folder_ / name);
}

TEST_F(Program, LooksAtTheSideOfTheModelThatIsNamed) {
  ASSERT_EQ(run({"encode", "y.ply", "y.skeleton.json", "-o", "z.skx.exr", "--size", "32", "--up", "z"}).code, 0);
  const auto picture = [&](std::vector<std::string> view) {
    std::vector<std::string> arguments{"render", "z.skx.exr", "-o", "a.png", "--size", "64x48", "--samples", "1"};
    arguments.insert(arguments.end(), view.begin(), view.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return text_of(folder_ / "a.png");
  };
  // The model stands along z and looks along -y; its left is x.
  const std::vector<std::array<const char*, 4>> sides{{"front", "-y", "0", "0"}, {"back", "+y", "180", "0"},
                                                      {"left", "+x", "90", "0"}, {"right", "-x", "-90", "0"},
                                                      {"top", "+z", "0", "90"},  {"bottom", "-z", "0", "-90"}};
  std::set<std::string> all;
  for (const auto& [side, axis, azimuth, elevation] : sides) {
    const std::string named = picture({"--view", side});
    EXPECT_EQ(named, picture({"--azimuth", azimuth, "--elevation", elevation})) << side;
    EXPECT_EQ(named, picture({"--view", axis})) << side;
    all.insert(named);
  }
  EXPECT_EQ(all.size(), sides.size());
  expect_refused(2, {"render", "y.ply", "-o", "b.png", "--view", "frnt"}, {"--view", "did you mean front?"});
  expect_refused(2, {"render", "y.ply", "-o", "b.png", "--view", "+w"}, {"--view", "+x"});
  expect_refused(2, {"render", "y.ply", "-o", "b.png", "--view", "left", "--azimuth", "3"}, {"--view", "--azimuth"});
  for (const char* name : {"a.png", "z.skx.exr"}) fs::remove(folder_ / name);
}

TEST_F(Program, TakesAllPosesOfAPatternAndDrawsThemAllTheWayRound) {
  const std::string bone = read_skeleton(folder_ / "y.skeleton.json").bones[1].name;
  fs::create_directory(folder_ / "poses");
  for (const int degrees : {20, 40})
    std::ofstream(folder_ / "poses" / fmt::format("bent{}.json", degrees))
        << nlohmann::json{{"rotations", {{bone, {{"axis", {1, 0, 0}}, {"degrees", degrees}}}}}};
  const nlohmann::json meshes =
      json_of({"reconstruct", "y.skx.exr", "--pose", "poses/*.json", "-o", "all_{name}.ply", "--no-report"});
  ASSERT_EQ(meshes.size(), 2u);
  EXPECT_EQ(meshes[1].at("output"), "all_bent40.ply");
  ASSERT_EQ(run({"reconstruct", "y.skx.exr", "--pose", "poses/bent40.json", "-o", "one.ply"}).code, 0);
  EXPECT_EQ(text_of(folder_ / "one.ply"), text_of(folder_ / "all_bent40.ply"));
  EXPECT_NE(text_of(folder_ / "one.ply"), text_of(folder_ / "all_bent20.ply"));

  const std::vector<std::string> small{"--size", "64x48", "--samples", "1"};
  const auto render = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "render");
    arguments.insert(arguments.end(), small.begin(), small.end());
    return json_of(arguments);
  };
  const nlohmann::json turned = render({"y.skx.exr", "--pose", "poses/*.json", "--turntable", "3", "-o", "{name}.png"});
  ASSERT_EQ(turned.size(), 2u);
  EXPECT_EQ(turned[0].at("pictures"), (std::vector<std::string>{"bent20_000.png", "bent20_001.png", "bent20_002.png"}));
  std::set<std::string> pictures;
  for (const nlohmann::json& pose : turned)
    for (const std::string path : pose.at("pictures")) pictures.insert(text_of(folder_ / path));
  EXPECT_EQ(pictures.size(), 6u);
  render({"y.skx.exr", "--pose", "poses/bent40.json", "--turntable", "3", "-o", "again.png"});
  EXPECT_EQ(text_of(folder_ / "again_001.png"), text_of(folder_ / "bent40_001.png"));
  EXPECT_EQ(render({"y.ply", "--turntable", "2", "-o", "mesh.png"}).at("pictures").size(), 2u);
  for (const char* name : {"all_bent20.ply", "all_bent40.ply", "one.ply", "mesh_000.png", "mesh_001.png"})
    EXPECT_TRUE(fs::remove(folder_ / name)) << name;
  for (const char* stem : {"bent20", "bent40", "again"})
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(fs::remove(folder_ / fmt::format("{}_{:03}.png", stem, i)));

  expect_refused(1, {"reconstruct", "y.skx.exr", "--pose", "none/*.json", "-o", "{name}.ply"}, {"none/*.json"});
  expect_refused(2, {"reconstruct", "y.skx.exr", "--pose", "poses/*.json", "-o", "a.ply"}, {"{name}", "2 poses"});
  expect_refused(1, {"reconstruct", "y.skx.exr", "--pose", "poses/*.json", "-o", "no/{name}.ply"}, {"no"});
  expect_refused(2, {"render", "y.skx.exr", "--turntable", "3", "--views", "2", "-o", "a.png"}, {"--turntable"});
  expect_refused(2, {"render", "y.skx.exr", "--turntable", "3", "--mode", "map", "-o", "a.png"}, {"texture"});
  std::ofstream(folder_ / "eye.json") << R"({"eye": [9, 0, 0]})";
  expect_refused(2, {"render", "y.skx.exr", "--turntable", "3", "--camera", "eye.json", "-o", "a.png"}, {"eye"});
  for (const char* more : {"a", "b"}) {
    fs::create_directory(folder_ / "poses" / more);
    fs::copy(folder_ / "poses" / "bent20.json", folder_ / "poses" / more / "bent20.json");
  }
  expect_refused(2, {"reconstruct", "y.skx.exr", "--pose", "poses/*/bent20.json", "-o", "{name}.ply"},
                 {"same name", "bent20.ply"});
  fs::remove_all(folder_ / "poses");
  fs::remove(folder_ / "eye.json");
}

TEST_F(Program, WarnsOfWhatACompactFileLeavesOutOnlyWhereTheInputHasIt) {
  const auto encode = [&](const char* mesh, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"encode", mesh, "y.skeleton.json", "-o", "c.skx",
                                       "--size", "64", "--quality",       "20"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments).err;
  };
  EXPECT_EQ(encode("y.ply"), "");
  const std::string without = text_of(folder_ / "c.skx");
  const TriangleMesh mesh = read_mesh(folder_ / "y.ply").mesh;
  MeshAttributes attributes;
  for (const Vec3& p : mesh.positions) attributes.normals.values.push_back(p.normalized());
  write_mesh(folder_ / "smooth.ply", mesh, attributes);
  EXPECT_NE(encode("smooth.ply").find("normals are left out"), std::string::npos);
  EXPECT_EQ(text_of(folder_ / "c.skx"), without);
  EXPECT_EQ(encode("smooth.ply", {"--no-normals"}), "");
  for (const char* name : {"c.skx", "smooth.ply"}) fs::remove(folder_ / name);
}

TEST_F(Program, RunsAnExperimentOnTheUsersOwnModelResumesAndReplaysIt) {
  std::ofstream(folder_ / "e.json") << R"({"name": "e", "sweep": {"size": [32, 48]}, "steps": [
    {"name": "encode", "run": ["encode", "{mesh}", "{skeleton}", "-o", "{work}/m.skx.exr", "--size", "{size}"]},
    {"name": "shape", "run": ["reconstruct", "{work}/m.skx.exr", "-o", "{work}/m.ply"]}],
    "columns": {"vertices": "shape.vertices", "used": "encode.atlas.used_fraction"}})";
  const std::vector<std::string> arguments{"run", "e.json", "--mesh",   "y.ply",  "--skeleton", "y.skeleton.json",
                                           "-o",  "out",    "--resume", "--json", "run.json"};
  for (const int kept : {0, 2}) {
    const Outcome outcome = run(arguments);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const auto report = nlohmann::json::parse(text_of(folder_ / "run.json")).at(0);
    EXPECT_EQ(report.at("done"), 2);
    EXPECT_EQ(report.at("kept"), kept);
  }
  const Outcome again = run({"replay", "out/e", "--json", "replay.json"});
  EXPECT_EQ(again.code, 0) << again.err << again.out;
  EXPECT_EQ(nlohmann::json::parse(text_of(folder_ / "replay.json")).at("differences").size(), 0u);
  const std::string record = text_of(folder_ / "out/e/record.json");
  expect_refused(2, {"replay", "out/e/record.json", "-o", "out/e"}, {"out/e", "RECORD"});
  EXPECT_EQ(text_of(folder_ / "out/e/record.json"), record);
  expect_refused(1, {"run", "e.json", "--set", "swep.size=1"}, {"swep", "did you mean sweep?"});
  expect_refused(1, {"run", "absent.json"}, {"absent.json"});
  expect_refused(2, {"run", "e.json", "--mesh", "y.ply"}, {"--skeleton"});
  expect_refused(2, {"run", "e.json", "--shard", "4/3"}, {"4/3", "1 <= I <= N"});
  expect_refused(1, {"collect", "absent"}, {"absent"});
  expect_refused(2, {"collect", "out/e", "out"}, {"--output"});
  const Outcome late =
      run({"run", "e.json", "--mesh", "y.ply", "--skeleton", "y.skeleton.json", "-o", "out", "--timeout", "0.001"});
  EXPECT_EQ(late.code, 1);
  EXPECT_NE(late.out.find("2 out of time"), std::string::npos) << late.out;
  const Outcome narrow = run({"run", "e.json", "--mesh", "y.ply", "--skeleton", "y.skeleton.json", "-o", "out",
                              "--memory", "300", "--allow-failures", "--shard", "1/2"});
  EXPECT_EQ(narrow.code, 0) << narrow.err;
  EXPECT_NE(narrow.out.find("1 out of memory"), std::string::npos) << narrow.out;
  fs::remove_all(folder_ / "out");
  for (const char* name : {"e.json", "run.json", "replay.json"}) fs::remove(folder_ / name);
}

TEST_F(Program, EndsWithOneOnInputThatIsMissingOrForeign) {
  std::ofstream(folder_ / "broken.json") << "{\"nodes\": [";
  std::ofstream(folder_ / "text.exr") << "no image at all, though long enough to be read as one";
  std::ofstream(folder_ / "broken.ply") << "ply\nformat ascii 1.0\nelement vertex 3\n";
  std::ofstream(folder_ / "empty.off") << "OFF\n0 0 0\n";
  expect_refused(1, {"encode", "absent.off", "y.skeleton.json", "-o", "a.skx.exr"}, {"absent.off"});
  expect_refused(1, {"encode", "y.ply", "absent.json", "-o", "a.skx.exr"}, {"absent.json"});
  expect_refused(1, {"encode", "y.ply", "broken.json", "-o", "a.skx.exr"}, {"broken.json"});
  expect_refused(1, {"encode", "broken.ply", "y.skeleton.json", "-o", "a.skx.exr"}, {"broken.ply"});
  expect_refused(1, {"reconstruct", "absent.skx.exr", "-o", "a.ply"}, {"absent.skx.exr"});
  expect_refused(1, {"reconstruct", "text.exr", "-o", "a.ply"}, {"text.exr"});
  expect_refused(1, {"inspect", "text.exr"}, {"text.exr"});
  expect_refused(1, {"inspect", "absent.ply"}, {"absent.ply"});
  expect_refused(1, {"metro", "empty.off", "y.ply"}, {"empty.off"});
  expect_refused(1, {"metro", "y.ply", "empty.off"}, {"empty.off"});
  expect_refused(1, {"validate", "y.skeleton.json", "y.skeleton.json"}, {"y.skeleton.json"});
  for (const char* name : {"broken.json", "text.exr", "broken.ply", "empty.off"}) fs::remove(folder_ / name);
}

TEST_F(Program, RefusesATruncatedModel) {
  const std::string whole = text_of(folder_ / "y.skx.exr");
  for (const double part : {0.0, 0.01, 0.3, 0.6, 0.99}) {
    std::ofstream(folder_ / "cut.skx.exr", std::ios::binary)
        << whole.substr(0, static_cast<std::size_t>(part * static_cast<double>(whole.size())));
    expect_refused(1, {"reconstruct", "cut.skx.exr", "-o", "a.ply"}, {"cut.skx.exr"});
  }
  fs::remove(folder_ / "cut.skx.exr");
}

TEST_F(Program, CorrespondsModelsAndSkeletonFiles) {
  const nlohmann::json json = json_of({"correspond", "y.skx.exr", "y.skeleton.json"});
  EXPECT_EQ(json.at("bones").size(), read_skeleton(folder_ / "y.skeleton.json").bones.size());
  for (const auto& bone : json.at("bones")) {
    EXPECT_EQ(bone.at("a"), bone.at("b"));
    EXPECT_EQ(bone.at("reversed"), false);
  }
  EXPECT_NEAR(json.at("cost").get<double>(), 0, 1e-9);
  const std::string first = json.at("bones")[0].at("a");
  expect_refused(2, {"correspond", "y.skx.exr", "y.skx.exr", "--bones", first}, {first, "BONE=BONE"});
  expect_refused(1, {"correspond", "y.skx.exr", "y.skx.exr", "--bones", first + "=" + first + "x"},
                 {first + "x", "did you mean " + first});
  std::ofstream(folder_ / "two.json")
      << R"({"nodes":[{"name":"p","position":[0,0,0]},{"name":"q","position":[1,0,0]}],"bones":[{"name":"b","head":0,"tail":1}]})";
  expect_refused(1, {"correspond", "y.skx.exr", "two.json"}, {"y.skx.exr", "two.json", "number of bones"});
}

TEST_F(Program, MorphsToModelsAndMeshes) {
  const nlohmann::json one = json_of({"morph", "y.skx.exr", "y.skx.exr", "--t", "0.25", "-o", "half.skx.exr"});
  EXPECT_EQ(one.at("results").at(0).at("kind"), "model");
  EXPECT_NEAR(one.at("maps").at(0).at("distortion").at("symmetric_dirichlet").get<double>(), 1, 0.01);
  EXPECT_EQ(run({"reconstruct", "half.skx.exr", "-o", "half.ply"}).code, 0);
  const nlohmann::json frames = json_of({"morph", "y.skx.exr", "half.skx.exr", "--frames", "3", "-o", "frame.ply"});
  ASSERT_EQ(frames.at("results").size(), 3u);
  for (const char* name : {"frame_000.ply", "frame_001.ply", "frame_002.ply"})
    EXPECT_TRUE(fs::remove(folder_ / name)) << name;
  EXPECT_EQ(run({"morph", "y.skx.exr", "half.skx.exr", "y.skx.exr", "--weights", "0.2,0.3,0.5", "-o", "three.skx.exr",
                 "--size", "32"})
                .code,
            0);
  EXPECT_TRUE(fs::remove(folder_ / "three.skx.exr"));

  const auto refused = [](int code, std::vector<std::string> more, const std::vector<std::string>& parts) {
    std::vector<std::string> arguments{"morph", "y.skx.exr", "half.skx.exr", "-o", "no.ply"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    expect_refused(code, arguments, parts);
  };
  refused(2, {}, {"--t", "--weights", "--frames"});
  refused(2, {"--t", "1.5"}, {"--t"});
  refused(2, {"--weights", "1"}, {"1 weights for 2 models"});
  refused(1, {"--weights", "0.5,0.4"}, {"sum"});
  refused(2, {"--t", "0.5", "--frames", "3"}, {"--t"});
  refused(2, {"--t", "0.5", "--layout", "3"}, {"--layout"});
  refused(1, {"--t", "0.5", "--bones", "nope=nope"}, {"nope"});
  expect_refused(2, {"morph", "y.skx.exr", "-o", "no.ply", "--t", "0"}, {"two models"});
  expect_refused(1, {"morph", "y.skx.exr", "y.ply", "--t", "0", "-o", "no.ply"}, {"y.ply"});
  expect_refused(2, {"morph", "y.skx.exr", "half.skx.exr", "--t", "0", "-o", "no.xyz"}, {"no.xyz"});
  for (const char* name : {"half.skx.exr", "half.ply"}) fs::remove(folder_ / name);
}

TEST_F(Program, TimesStagesBesideTheirReferencesAndReportsWhatTheContractNames) {
  std::ofstream(folder_ / "y.json")
      << R"({"name": "Y", "mesh": "y.ply", "skeleton": "y.skeleton.json", "credits": ""})";
  const auto expect_stages = [](const nlohmann::json& rows, const std::vector<std::string>& stages) {
    ASSERT_EQ(rows.size(), stages.size());
    for (std::size_t i = 0; i < stages.size(); ++i) {
      const nlohmann::json& row = rows[i];
      expect_keys(row, {"stage", "model", "size", "ms", "reference", "reference_ms", "ratio", "wall_ms",
                        "frames_per_second", "ms_min", "ms_max", "device_ms", "launches", "repeats", "device"});
      EXPECT_EQ(row["stage"], stages[i]);
      EXPECT_EQ(row["repeats"], 2);
      if (stages[i] == "snap") {  // a difference
        EXPECT_GT(row["encoding_ms"], 0);
        EXPECT_GT(row["even_encoding_ms"], 0);
      } else {
        EXPECT_GT(row["ms"], 0);
      }
      EXPECT_GE(row["wall_ms"], row["ms"]) << "a frame holds its kernels";
      EXPECT_NEAR(row["ratio"].get<double>() * row["reference_ms"].get<double>(), row["ms"].get<double>(), 1e-9);
    }
  };
  expect_stages(json_of({"bench", "y.skx.exr", "--repeats", "2"}), {"reconstruct", "pose", "filter"});
  const nlohmann::json two = json_of({"bench", "y.skx.exr", "y.skx.exr", "--size", "96", "--repeats", "2"});
  expect_stages(two, {"reconstruct", "pose", "morph", "transfer", "filter"});
  EXPECT_EQ(two[0]["size"], 96);
  expect_stages(json_of({"bench", "y.json", "--stage", "encode,snap,vsm,metro,segment,spd_rays", "--size", "64",
                         "--repeats", "2"}),
                {"vsm", "spd_rays", "metro", "segment", "encode", "snap"});
  expect_refused(2, {"bench", "y.skx.exr", "y.skx.exr", "y.skx.exr"}, {"one model, or two"});
  expect_refused(2, {"bench", "y.skx.exr", "--stage", "morph"}, {"--stage", "morph", "two models"});
  expect_refused(2, {"bench", "y.skx.exr", "--stage", "vsm"}, {"--stage", "vsm", "skeleton"});
  expect_refused(2, {"bench", "--stage", "morf"}, {"morf", "morph"});
  expect_refused(1, {"bench", "y.ply"}, {"y.ply"});
  std::ofstream(folder_ / "gone.json")
      << R"({"name": "gone", "mesh": "gone.off", "skeleton": "y.skeleton.json", "credits": ""})";
  expect_refused(1, {"bench", "gone.json"}, {"gone.off", "install-dependencies"});
}

TEST_F(Program, RefusesOutputsThatCannotBeWrittenAndLeavesNothingBehind) {
  expect_refused(1, {"encode", "y.ply", "y.skeleton.json", "-o", "no/such/folder/a.skx.exr"}, {"no/such/folder"});
  expect_refused(2, {"reconstruct", "y.skx.exr", "-o", "."}, {"."});
  expect_refused(2, {"reconstruct", "y.skx.exr", "-o", "a.xyz"}, {"a.xyz"});
  expect_refused(1, {"metro", "y.ply", "y.ply", "--csv", "no/d.csv"}, {"no/d.csv"});
  expect_refused(1, {"inspect", "y.skx.exr", "--json", "no/i.json"}, {"no/i.json"});
  expect_refused(1, {"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--json", "no/e.json"}, {"no/e.json"});
  expect_refused(1, {"segment", "y.ply", "y.skeleton.json", "-o", "/proc/a.ply"}, {"/proc"});
}

TEST_F(Program, NeverWritesOverWhatItReads) {
  const auto bytes = [&](const char* name) {
    std::ostringstream text;
    text << std::ifstream(folder_ / name).rdbuf();
    return text.str();
  };
  const auto count = [&] { return std::distance(fs::directory_iterator(folder_), fs::directory_iterator()); };
  fs::create_symlink("y.skx.exr", folder_ / "link.exr");
  const std::string mesh = bytes("y.ply"), skeleton = bytes("y.skeleton.json"), model = bytes("y.skx.exr");
  const auto files = count();
  expect_refused(2, {"encode", "y.ply", "y.skeleton.json", "-o", "a.skx.exr", "--json", "y.skeleton.json"},
                 {"--json", "SKELETON"});
  expect_refused(2, {"encode", "y.ply", "y.skeleton.json", "-o", "y.ply"}, {"--output", "MESH"});
  expect_refused(2, {"metro", "y.ply", "y.ply", "--ply", "y.ply"}, {"--ply", "A"});
  expect_refused(2, {"lod", "y.skx.exr", "--size", "64", "-o", "link.exr"}, {"--output", "MODEL"});
  expect_refused(2, {"encode", "y.ply", "y.skeleton.json", "-o", "-"}, {"--output"});
  expect_refused(2, {"morph", "y.skx.exr", "half.skx.exr", "--frames", "2", "-o", "a.ply", "--json", "a_001.ply"},
                 {"--json", "a_001.ply"});
  std::ofstream(folder_ / "config.json") << nlohmann::json{
      {"name", "y"}, {"mesh", "y.ply"}, {"skeleton", "y.skeleton.json"}, {"credits", "made here"}};
  expect_refused(2, {"render", "config.json", "-o", "a.png", "--json", "y.skeleton.json"},
                 {"--json", "skeleton of config.json"});
  fs::remove(folder_ / "config.json");
  EXPECT_EQ(bytes("y.ply"), mesh);
  EXPECT_EQ(bytes("y.skeleton.json"), skeleton);
  EXPECT_EQ(bytes("y.skx.exr"), model);
  EXPECT_EQ(count(), files);
  fs::remove(folder_ / "link.exr");
}

/// y.ply and y.skeleton.json as moved.off and moved.json, times a scale and moved along every axis.
void write_moved(const fs::path& folder, double scale, double offset) {
  const TriangleMesh mesh = read_mesh(folder / "y.ply").mesh;
  std::ofstream off(folder / "moved.off");
  off.precision(17);
  off << "OFF\n" << mesh.positions.size() << ' ' << mesh.triangles.size() << " 0\n";
  for (const Vec3& p : mesh.positions) {
    const Vec3 q = scale * p + Vec3::Constant(offset);
    off << q.x() << ' ' << q.y() << ' ' << q.z() << '\n';
  }
  for (const Triangle& t : mesh.triangles) off << "3 " << t[0] << ' ' << t[1] << ' ' << t[2] << '\n';
  nlohmann::json json = nlohmann::json::parse(std::ifstream(folder / "y.skeleton.json"));
  for (auto& node : json["nodes"])
    for (auto& x : node["position"]) x = scale * x.get<double>() + offset;
  std::ofstream(folder / "moved.json") << json;
}

TEST_F(Program, GivesTheSameTexelsAtEveryScaleAndTheUsersUnitsBack) {
  const DisplacementTexture own = read_model(folder_ / "y.skx.exr").texture;
  const double diagonal = bounding_box(read_mesh(folder_ / "y.ply").mesh).diagonal();
  std::ofstream(folder_ / "still.json") << R"({"rotations": {}})";
  for (const double scale : {1e-30, 1e-19, 1e15, 1e30}) {
    SCOPED_TRACE(scale);
    write_moved(folder_, scale, 0);
    const nlohmann::json report = json_of({"encode", "moved.off", "moved.json", "-o", "moved.skx.exr", "--size", "64"});
    const SkeletexModel model = read_model(folder_ / "moved.skx.exr");
    EXPECT_EQ(model.texture.along, own.along);
    EXPECT_EQ(model.texture.around, own.around);
    EXPECT_EQ(model.texture.out, own.out);
    EXPECT_NEAR(model.skeleton.frame.scale / (scale * diagonal), 1, 1e-12);
    for (const char* pose : {"", "still.json"}) {
      std::vector<std::string> command{"reconstruct", "moved.skx.exr", "-o", "moved.ply"};
      if (*pose) command.insert(command.end(), {"--pose", pose});
      json_of(command);
      const nlohmann::json metro = json_of({"metro", "moved.off", "moved.ply"});
      EXPECT_LT(metro["forward"]["mean"], 1e-3);
      EXPECT_NEAR(metro["diagonal"].get<double>() / (scale * diagonal), 1, 1e-12);
    }
    EXPECT_NEAR(report["mesh"]["diagonal"].get<double>() / (scale * diagonal), 1, 1e-9);
    EXPECT_NE(run({"inspect", "moved.skx.exr"}).out.find(fmt::format("{:.3g}", scale * diagonal).substr(0, 4)),
              std::string::npos);
    EXPECT_EQ(run({"validate", "moved.off", "moved.json"}).code, 0);
    json_of({"segment", "moved.off", "moved.json", "-o", "moved.ply"});
    json_of({"morph", "moved.skx.exr", "moved.skx.exr", "--t", "0.5", "-o", "moved.ply"});
    EXPECT_LT(json_of({"metro", "moved.off", "moved.ply"})["forward"]["mean"], 1e-3);
  }
}

TEST_F(Program, FarFromTheOriginModelsAreAsGoodAsAtIt) {
  const auto error_at = [&](double offset) {
    write_moved(folder_, 1, offset);
    json_of({"encode", "moved.off", "moved.json", "-o", "moved.skx.exr", "--size", "256"});
    json_of({"reconstruct", "moved.skx.exr", "-o", "moved.ply"});
    json_of({"reconstruct", "moved.skx.exr", "-o", "moved.obj"});
    double error = 0;
    for (const char* mesh : {"moved.ply", "moved.obj"}) {
      error = std::max(error, json_of({"metro", "moved.off", mesh})["forward"]["mean"].get<double>());
    }
    return error;
  };
  const double own = error_at(0);
  for (const double offset : {1e4, 1e6}) EXPECT_NEAR(error_at(offset) / own, 1, 0.02) << offset;
}

TEST_F(Program, PosesNodesInTheUsersUnitsAndMorphsBetweenScales) {
  write_moved(folder_, 1000, 1e5);
  json_of({"encode", "moved.off", "moved.json", "-o", "moved.skx.exr", "--size", "64"});
  // All nodes move by one vector: so does the mesh.
  nlohmann::json pose;
  const nlohmann::json skeleton = nlohmann::json::parse(std::ifstream(folder_ / "moved.json"));
  for (const auto& node : skeleton["nodes"]) {
    const auto p = node["position"].get<std::array<double, 3>>();
    pose["nodes"][node["name"].get<std::string>()] = {p[0] + 500, p[1], p[2]};
  }
  std::ofstream(folder_ / "pose.json") << pose;
  json_of({"reconstruct", "moved.skx.exr", "-o", "a.ply"});
  json_of({"reconstruct", "moved.skx.exr", "-o", "b.ply", "--pose", "pose.json"});
  const TriangleMesh a = read_mesh(folder_ / "a.ply").mesh, b = read_mesh(folder_ / "b.ply").mesh;
  ASSERT_EQ(a.positions.size(), b.positions.size());
  for (std::size_t i = 0; i < a.positions.size(); ++i)
    ASSERT_LT((b.positions[i] - a.positions[i] - Vec3(500, 0, 0)).norm(), 1e-2) << i;
  // Half way between y and a thousand times y lies 500.5 times y.
  json_of({"morph", "y.skx.exr", "moved.skx.exr", "--t", "0.5,1", "-o", "between.ply"});
  write_moved(folder_, 500.5, 0.5e5);
  EXPECT_LT(json_of({"metro", "moved.off", "between_000.ply"})["forward"]["mean"], 1e-3);
  write_moved(folder_, 1000, 1e5);
  EXPECT_LT(json_of({"metro", "moved.off", "between_001.ply"})["forward"]["mean"], 1e-3);
}

/// An environment variable while it lives.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) {
    if (const char* before = std::getenv(name)) before_ = before;
    ::setenv(name, value.c_str(), 1);
  }
  ~Variable() { before_ ? ::setenv(name_, before_->c_str(), 1) : ::unsetenv(name_); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* name_;
  std::optional<std::string> before_;
};

TEST_F(Program, SaysThatCompiledKernelsCannotBeWritten) {
  const std::string device = json_of({"devices"}).dump();
  if (device.find("Portable Computing Language") == std::string::npos) GTEST_SKIP() << "the device is none of PoCL's";
  std::ofstream(folder_ / "file") << "no folder";
  for (const std::string& cache : {(folder_ / "file").string(), std::string("/proc/cache")}) {
    const Variable variable("POCL_CACHE_DIR", cache);
    expect_refused(1, {"metro", "y.ply", "y.ply"}, {"PoCL cannot write its compiled kernels to " + cache});
  }
  fs::remove(folder_ / "file");
}

#ifndef __SANITIZE_ADDRESS__
TEST_F(Program, SaysThatAddressesAreLimited) {
  for (const rlim_t mebibytes : {300u, 500u, 900u}) {
    rlimit before{};
    ::getrlimit(RLIMIT_AS, &before);
    const rlimit limit{mebibytes << 20, before.rlim_max};
    ::setrlimit(RLIMIT_AS, &limit);
    const Outcome outcome = run({"encode", "y.ply", "y.skeleton.json", "-o", "limited.skx.exr", "--size", "2048"});
    ::setrlimit(RLIMIT_AS, &before);
    EXPECT_EQ(outcome.code, 1) << mebibytes << ": " << outcome.err;
    EXPECT_NE(outcome.err.find("ulimit -v"), std::string::npos) << mebibytes << ": " << outcome.err;
    EXPECT_FALSE(fs::exists(folder_ / "limited.skx.exr"));
  }
}
#endif

TEST_F(Program, RefusesSizesThatNoMachineHasTheMemoryFor) {
  if (available_memory().bytes > std::uint64_t{90} << 30) GTEST_SKIP() << "a large machine";
  expect_refused(1, {"encode", "y.ply", "y.skeleton.json", "-o", "huge.skx.exr", "--size", "16384"},
                 {"GiB of memory", "leaves"});
}

TEST_F(Program, NamesInFilesCannotSteerTheTerminal) {
  nlohmann::json skeleton = nlohmann::json::parse(std::ifstream(folder_ / "y.skeleton.json"));
  for (auto& bone : skeleton["bones"])
    bone["name"] = "\x1b[31m\xc2\x9b" + bone["name"].get<std::string>() + "\x07\x7f\n";
  std::ofstream(folder_ / "steer.json") << skeleton;
  skeleton["nodes"][0]["position"] = {90, 90, 90};
  std::ofstream(folder_ / "outside.json") << skeleton;
  const std::string is_control = "\x1b\x07\x7f";
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"encode", "y.ply", "steer.json", "-o", "steer.skx.exr", "--size", "64", "--verbose"},
        {"inspect", "steer.skx.exr"},
        {"inspect", "steer.skx.exr", "--json", "-"},
        {"weights", "steer.skx.exr", "-o", "steered.skx.exr"},
        {"correspond", "steer.skx.exr", "steer.json"},
        {"segment", "y.ply", "steer.json", "-o", "steer.ply"},
        {"validate", "y.ply", "outside.json"},
        {"encode", "y.ply", "outside.json", "-o", "steer.skx.exr"},
        {"transfer", "steer.skx.exr", "steer.skx.exr", "-o", "steer.ply", "--bones", "no=no"},
        {"metro", "\x1b[31m.ply", "y.ply"}}) {
    const Outcome outcome = run(command);
    const std::string text = outcome.out + outcome.err;
    EXPECT_FALSE(text.empty());
    EXPECT_EQ(text.find_first_of(is_control), std::string::npos) << command[0] << ": " << text;
    EXPECT_EQ(text.find("\xc2\x9b"), std::string::npos) << command[0] << ": " << text;
  }
  for (const char* name : {"steer.json", "outside.json", "steer.skx.exr", "steered.skx.exr", "steer.ply"})
    fs::remove(folder_ / name);
}

TEST_F(Program, TakesOverWhatAnotherProgramHasChanged) {
  ASSERT_EQ(
      run({"encode", "y.ply", "y.skeleton.json", "-o", "edited.skx.exr", "--size", "64", "--compression", "none"}).code,
      0);
  std::string bytes = text_of(folder_ / "edited.skx.exr");
  bytes[bytes.size() - 2] ^= 1;
  std::ofstream(folder_ / "edited.skx.exr", std::ios::binary) << bytes;
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"inspect", "edited.skx.exr"}, {"reconstruct", "edited.skx.exr", "-o", "edited.ply"}})
    expect_refused(1, command, {"edited.skx.exr", "checksum", "weights edited.skx.exr --edited"});
  EXPECT_EQ(run({"weights", "edited.skx.exr", "--edited", "-o", "taken.skx.exr"}).code, 0);
  EXPECT_EQ(run({"inspect", "taken.skx.exr"}).code, 0);
  for (const char* name : {"edited.skx.exr", "taken.skx.exr"}) fs::remove(folder_ / name);
}

TEST_F(Program, WarnsOfAMeshThatWasCut) {
  json_of({"reconstruct", "y.skx.exr", "-o", "cut.obj"});
  std::string text = text_of(folder_ / "cut.obj");
  std::ofstream(folder_ / "cut.obj", std::ios::binary) << text.substr(0, text.size() - 1);
  EXPECT_EQ(run({"validate", "cut.obj", "y.skeleton.json"}).err.find("cut"), std::string::npos);
  text.resize(text.rfind("\nf ", text.size() / 8 * 7));
  std::ofstream(folder_ / "cut.obj", std::ios::binary) << text;
  EXPECT_NE(run({"validate", "cut.obj", "y.skeleton.json"}).err.find("may have been cut"), std::string::npos);
  fs::remove(folder_ / "cut.obj");
}

TEST_F(Program, ClosesAMeshWithAWideHole) {
  TriangleMesh mesh = y_shape().mesh;
  const double low = bounding_box(mesh).lower.y();
  std::erase_if(mesh.triangles, [&](const Triangle& t) {
    return std::any_of(t.begin(), t.end(), [&](int v) { return mesh.positions[v].y() < low + 0.3; });
  });
  write_mesh(folder_ / "open.ply", mesh);
  expect_refused(1, {"encode", "open.ply", "y.skeleton.json", "-o", "c.skx.exr"}, {"not closed", "--close"});
  const Outcome closed = run({"encode", "open.ply", "y.skeleton.json", "-o", "c.skx.exr", "--size", "64", "--close"});
  EXPECT_EQ(closed.code, 0) << closed.err;
  EXPECT_NE(closed.err.find("filled 1 hole"), std::string::npos) << closed.err;
  for (const char* name : {"open.ply", "c.skx.exr"}) fs::remove(folder_ / name);
}

TEST_F(Program, SplitsVerticesWhereAMeshTouchesItselfAndKeepsTheirNumbers) {
  // Dents from both sides of a capsule meet beside its bone; a triangle is missing.
  const Shape capsule = capsule_shape();
  TriangleMesh mesh = capsule.mesh;
  const auto nearest = [&](const Vec3& p) {
    return std::min_element(mesh.positions.begin(), mesh.positions.end(),
                            [&](const Vec3& a, const Vec3& b) { return (a - p).norm() < (b - p).norm(); });
  };
  const Vec3 meeting(0, 0.3, 0);
  for (const Vec3& side : {Vec3(0.4, 0.3, 0), Vec3(-0.4, 0.3, 0)}) *nearest(side) = meeting;
  mesh.triangles.pop_back();
  std::ofstream file(folder_ / "dented.ply");
  file << "ply\nformat ascii 1.0\nelement vertex " << mesh.positions.size()
       << "\nproperty double x\nproperty double y\nproperty double z\nproperty float height\nelement face "
       << mesh.triangles.size() << "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const Vec3& p : mesh.positions) file << p.x() << ' ' << p.y() << ' ' << p.z() << ' ' << p.z() + 2 << '\n';
  for (const Triangle& t : mesh.triangles) file << "3 " << t[0] << ' ' << t[1] << ' ' << t[2] << '\n';
  file.close();
  std::ofstream(folder_ / "capsule.skeleton.json") << skeleton_to_json(capsule.skeleton);
  const Outcome closed =
      run({"encode", "dented.ply", "capsule.skeleton.json", "-o", "c.skx.exr", "--size", "64", "--close"});
  ASSERT_EQ(closed.code, 0) << closed.err;
  EXPECT_NE(closed.err.find("1 vertex was added"), std::string::npos) << closed.err;
  ASSERT_EQ(run({"reconstruct", "c.skx.exr", "-o", "c.ply"}).code, 0);
  const MeshFile back = read_mesh(folder_ / "c.ply");
  const auto& numbers = back.attributes.numbers;
  const auto height = std::find_if(numbers.begin(), numbers.end(), [](const auto& n) { return n.name == "height"; });
  ASSERT_NE(height, numbers.end());
  double largest = 0;
  for (std::size_t v = 0; v < back.mesh.positions.size(); ++v)
    largest = std::max(largest, std::abs(height->values[v] - 2 - back.mesh.positions[v].z()));
  EXPECT_LT(largest, 0.1);
  for (const char* name : {"dented.ply", "capsule.skeleton.json", "c.skx.exr", "c.ply"}) fs::remove(folder_ / name);
}

void add_part(const TriangleMesh& part, const Vec3& offset, TriangleMesh& mesh) {
  const int first = static_cast<int>(mesh.positions.size());
  for (const Vec3& p : part.positions) mesh.positions.push_back(p + offset);
  for (const Triangle& t : part.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

TEST_F(Program, UnitesPartsThatOverlap) {
  if (!fs::exists(fs::path(SKELETEX_PROGRAM).parent_path() / "skeletex_wrap")) GTEST_SKIP() << "built without CGAL";
  constexpr double kRadius = 0.5;
  const TriangleMesh upright = capsule_shape(3, kRadius).mesh;
  Similarity turn;
  turn.rotation = Eigen::AngleAxisd(M_PI / 2, Vec3(0.01, 1, 0).normalized()).toRotationMatrix();
  TriangleMesh cross = upright;
  add_part(transformed(upright, turn), Vec3(0, 0.01, 0), cross);
  add_part(capsule_shape(0.19, 0.0315).mesh, Vec3(1, 1, 1), cross);  // loose, 0.2 % of the area
  write_mesh(folder_ / "cross.ply", cross);
  const Outcome closed =
      run({"encode", "cross.ply", "-o", "c.skx.exr", "--size", "128", "--close", "--json", "c.json"});
  ASSERT_EQ(closed.code, 0) << closed.err;
  const nlohmann::json json = nlohmann::json::parse(text_of(folder_ / "c.json"));
  EXPECT_EQ(json["close"]["method"], "union") << closed.err;
  EXPECT_EQ(json["close"]["parts"], 3);
  EXPECT_NE(closed.err.find("1 part with less than 0.5 % of the area is left out"), std::string::npos) << closed.err;
  EXPECT_LT(json["mesh"]["triangles"].get<std::size_t>(), 1.2 * static_cast<double>(cross.triangles.size()));
  json_of({"reconstruct", "c.skx.exr", "-o", "c.ply"});
  const double common = 16.0 / 3 * kRadius * kRadius * kRadius;  // of two cylinders that cross
  const double volume = 2 * signed_volume(upright) - common;
  EXPECT_NEAR(signed_volume(read_mesh(folder_ / "c.ply").mesh), volume, 0.02 * volume);
  for (const char* name : {"cross.ply", "c.skx.exr", "c.json", "c.ply"}) fs::remove(folder_ / name);
}

TEST_F(Program, DoesNotCloseTheGapOfAnOpenRing) {
  if (!fs::exists(fs::path(SKELETEX_PROGRAM).parent_path() / "skeletex_wrap")) GTEST_SKIP() << "built without CGAL";
  // A ring that is cut through, and a part of its own in the middle: a wrap of both closes the ring.
  constexpr int kAlong = 240;
  TriangleMesh mesh = torus_shape(5, 2, 0.5, kAlong, 16).mesh;
  std::erase_if(mesh.triangles, [&](const Triangle& t) {
    const Vec3 centre = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
    const double angle = std::atan2(centre.y(), centre.x());
    return angle > 0 && angle < 2 * M_PI / kAlong;
  });
  add_part(capsule_shape(0.2, 0.1).mesh, Vec3::Zero(), mesh);
  write_mesh(folder_ / "ring.ply", mesh);
  const Outcome closed = run({"encode", "ring.ply", "-o", "c.skx.exr", "--size", "64", "--close", "--json", "c.json"});
  ASSERT_EQ(closed.code, 0) << closed.err;
  EXPECT_NE(closed.err.find("taken alone"), std::string::npos) << closed.err;
  EXPECT_EQ(nlohmann::json::parse(text_of(folder_ / "c.json"))["mesh"]["genus"], 0);
  for (const char* name : {"ring.ply", "c.skx.exr", "c.json"}) fs::remove(folder_ / name);
}

TEST_F(Program, CutsHandlesOff) {
  // Numbers and colours of a ring are those of its places afterwards, too.
  const TriangleMesh mesh = torus_shape(5, 2, 0.3, 80, 16).mesh;
  std::ofstream file(folder_ / "ring.ply");
  file << "ply\nformat ascii 1.0\nelement vertex " << mesh.positions.size()
       << "\nproperty double x\nproperty double y\nproperty double z\nproperty float height\n"
       << "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face " << mesh.triangles.size()
       << "\nproperty list uchar int vertex_indices\nend_header\n";
  const auto red = [](double z) { return std::lround(128 + 300 * z); };
  for (const Vec3& p : mesh.positions)
    file << p.x() << ' ' << p.y() << ' ' << p.z() << ' ' << p.z() << ' ' << red(p.z()) << " 50 200\n";
  for (const Triangle& t : mesh.triangles) file << "3 " << t[0] << ' ' << t[1] << ' ' << t[2] << '\n';
  file.close();
  const double around = 2 * M_PI * 0.3 / bounding_box(mesh).diagonal();
  for (const double longest : {0.9 * around, 1.1 * around}) {
    SCOPED_TRACE(longest);
    const Outcome cut = run({"encode", "ring.ply", "-o", "c.skx.exr", "--size", "64", "--close", "--close-handles",
                             std::to_string(longest), "--json", "c.json"});
    ASSERT_EQ(cut.code, 0) << cut.err;
    const nlohmann::json json = nlohmann::json::parse(text_of(folder_ / "c.json"));
    const bool is_cut = longest > around;
    EXPECT_EQ(json["close"]["cut_loops"].size(), is_cut ? 1u : 0u);
    EXPECT_EQ(json["mesh"]["genus"], is_cut ? 0 : 1);
    EXPECT_EQ(cut.err.find("cut off") != std::string::npos, is_cut) << cut.err;
  }
  json_of({"reconstruct", "c.skx.exr", "-o", "c.ply"});
  const MeshFile back = read_mesh(folder_ / "c.ply");
  ASSERT_EQ(back.attributes.numbers.size(), 1u);
  for (std::size_t v = 0; v < back.mesh.positions.size(); ++v)
    EXPECT_NEAR(back.attributes.numbers[0].values[v], back.mesh.positions[v].z(), 0.1);
  ASSERT_EQ(back.attributes.colours.values.size(), back.mesh.positions.size());
  const auto linear = [](long byte) {
    return std::pow((static_cast<double>(byte) / 255 + 0.055) / 1.055, 2.4);
  };  // of sRGB
  for (std::size_t v = 0; v < back.mesh.positions.size(); ++v) {
    EXPECT_NEAR(back.attributes.colours.values[v][0], linear(red(back.mesh.positions[v].z())), 0.12);
    EXPECT_NEAR(back.attributes.colours.values[v][2], linear(200), 0.02);
  }
  expect_refused(2, {"encode", "ring.ply", "-o", "c.skx.exr", "--close-handles", "0.1"}, {"--close"});
  for (const char* name : {"ring.ply", "c.skx.exr", "c.json", "c.ply"}) fs::remove(folder_ / name);
}

/// A plate of cubes with holes in a grid.
TriangleMesh plate_with_holes(int columns, int rows) {
  TriangleMesh mesh;
  const auto is_solid = [&](int x, int y, int z) {
    return x >= 0 && x <= 2 * columns && y >= 0 && y <= 2 * rows && z == 0 && !(x % 2 == 1 && y % 2 == 1);
  };
  std::map<std::array<int, 3>, int> vertices;
  const auto vertex = [&](std::array<int, 3> place) {
    const auto [found, is_new] = vertices.emplace(place, static_cast<int>(mesh.positions.size()));
    if (is_new) mesh.positions.emplace_back(place[0], place[1], place[2]);
    return found->second;
  };
  for (int x = 0; x <= 2 * columns; ++x)
    for (int y = 0; y <= 2 * rows; ++y)
      for (int axis = 0; axis < 3; ++axis)
        for (const int side : {0, 1}) {
          std::array<int, 3> beside{x, y, 0};
          beside[axis] += side == 1 ? 1 : -1;
          if (!is_solid(x, y, 0) || is_solid(beside[0], beside[1], beside[2])) continue;
          const int u = (axis + 1) % 3, v = (axis + 2) % 3;
          std::array<int, 4> corners{};
          for (int k = 0; k < 4; ++k) {
            std::array<int, 3> place{x, y, 0};
            place[axis] += side;
            place[u] += k == 1 || k == 2 ? 1 : 0;
            place[v] += k >= 2 ? 1 : 0;
            corners[k] = vertex(place);
          }
          if (side == 0) std::swap(corners[1], corners[3]);
          mesh.triangles.push_back({corners[0], corners[1], corners[2]});
          mesh.triangles.push_back({corners[0], corners[2], corners[3]});
        }
  return mesh;
}

TEST_F(Program, CutsAllHandlesOffWhereNoSkeletonWorksWithThem) {
  write_mesh(folder_ / "plate.ply", plate_with_holes(17, 3));  // 51 handles, one more than skeletons are tried for
  expect_refused(1, {"encode", "plate.ply", "-o", "p.skx.exr"}, {"51 handles", "--close"});
  expect_refused(1, {"encode", "plate.ply", "-o", "p.skx.exr", "--close", "--close-handles", "0"}, {"51 handles"});
  const Outcome cut = run({"encode", "plate.ply", "-o", "p.skx.exr", "--size", "64", "--close", "--json", "p.json"});
  ASSERT_EQ(cut.code, 0) << cut.err;
  EXPECT_NE(cut.err.find("no skeleton works with the 51 handles"), std::string::npos) << cut.err;
  const nlohmann::json json = nlohmann::json::parse(text_of(folder_ / "p.json"));
  EXPECT_EQ(json["close"]["cut_loops"].size(), 51u);
  EXPECT_EQ(json["mesh"]["genus"], 0);
  for (const char* name : {"plate.ply", "p.skx.exr", "p.json"}) fs::remove(folder_ / name);
}

TEST_F(Program, ClosesRigs) {
  // A ring whose joints are an open chain.
  const TriangleMesh ring = torus_shape(5, 2, 0.25, 80, 16).mesh;
  GltfScene scene;
  GltfPrimitive primitive;
  primitive.positions = ring.positions;
  primitive.triangles = ring.triangles;
  primitive.influences = 4;
  for (std::size_t v = 0; v < ring.positions.size(); ++v) {
    primitive.joints.insert(primitive.joints.end(), {0, 0, 0, 0});
    primitive.weights.insert(primitive.weights.end(), {1, 0, 0, 0});
  }
  scene.meshes.push_back({"ring", {primitive}});
  scene.nodes.resize(4);
  scene.nodes[0].mesh = scene.nodes[0].skin = 0;
  GltfSkin skin;
  Vec3 before = Vec3::Zero();
  for (const int joint : {1, 2, 3}) {
    const Vec3 place = 2 * Vec3(std::cos(joint), std::sin(joint), 0);
    scene.nodes[joint].name = std::string(1, static_cast<char>('a' + joint));
    scene.nodes[joint].parent = joint > 1 ? joint - 1 : -1;
    scene.nodes[joint].translation = place - before;
    Eigen::Matrix4d& inverse = skin.inverse_binds.emplace_back(Eigen::Matrix4d::Identity());
    inverse.block<3, 1>(0, 3) = -place;
    skin.joints.push_back(joint);
    before = place;
  }
  scene.skins.push_back(skin);
  write_gltf(folder_ / "ring.glb", scene);
  const auto cut_loops = [&](std::vector<std::string> options) {
    options.insert(options.begin(), {"import", "ring.glb", "-o", "parts", "--json", "c.json", "--close"});
    const Outcome outcome = run(options);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return nlohmann::json::parse(text_of(folder_ / "c.json"))["close"]["cut_loops"].size();
  };
  EXPECT_EQ(cut_loops({}), 1u);
  EXPECT_EQ(cut_loops({"--close-handles", "0"}), 0u);
  // Of a mesh that is open, joints outside are not reported: they are moved once it is closed.
  scene.meshes[0].primitives[0].triangles.pop_back();
  scene.skins[0].inverse_binds[2](2, 3) = -1;
  write_gltf(folder_ / "ring.glb", scene);
  const Outcome outcome = run({"encode", "ring.glb", "-o", "no.skx.exr"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("not closed"), std::string::npos) << outcome.err;
  EXPECT_EQ(outcome.err.find("lies outside"), std::string::npos) << outcome.err;
  // Without joints there is a mesh, and no complaint about a skeleton.
  scene.skins.clear();
  scene.meshes[0].primitives[0].influences = 0;
  scene.meshes[0].primitives[0].joints.clear();
  scene.meshes[0].primitives[0].weights.clear();
  for (GltfNode& node : scene.nodes) node.skin = -1;
  write_gltf(folder_ / "ring.glb", scene);
  fs::remove_all(folder_ / "parts");
  const Outcome bare = run({"import", "ring.glb", "-o", "parts"});
  EXPECT_EQ(bare.code, 0) << bare.err;
  EXPECT_NE(bare.out.find("not closed"), std::string::npos) << bare.out;
  EXPECT_EQ(bare.out.find("skeleton"), std::string::npos) << bare.out;
  // A mesh that is inside out is written the right way round.
  std::vector<Triangle>& triangles = scene.meshes[0].primitives[0].triangles;
  triangles = ring.triangles;
  for (Triangle& t : triangles) std::swap(t[1], t[2]);
  write_gltf(folder_ / "ring.glb", scene);
  const Outcome turned = run({"import", "ring.glb", "-o", "parts"});
  EXPECT_EQ(turned.code, 0) << turned.err;
  EXPECT_NE(turned.out.find("all its triangles were turned"), std::string::npos) << turned.out;
  EXPECT_GT(signed_volume(read_mesh(folder_ / "parts" / "mesh.ply").mesh), 0);
  fs::remove(folder_ / "c.json");
  fs::remove(folder_ / "ring.glb");
  fs::remove_all(folder_ / "parts");
}

TEST_F(Program, SaysWhenStandardOutputIsFull) {
  const Outcome outcome = run({"inspect", "y.skx.exr", "--json", "-"}, "/dev/full");
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("standard output"), std::string::npos) << outcome.err;
}

TEST_F(Program, ShowsProgressOnATerminalAndNeverInAPipe) {
  const std::vector<std::string> arguments{"encode", "y.ply", "y.skeleton.json", "-o", "p.skx.exr", "--size", "64"};
  const Outcome piped = run(arguments);
  EXPECT_EQ(piped.code, 0);
  EXPECT_EQ(piped.err, "");
  for (const char c : {'\r', '\033'}) EXPECT_EQ((piped.out + piped.err).find(c), std::string::npos);
  EXPECT_NE(run_on_terminal(arguments).find("\r\033[K[###"), std::string::npos);
  fs::remove(folder_ / "p.skx.exr");
}

TEST_F(Program, SaysOnATerminalThatItCompilesKernelsAndOnlyTheFirstTime) {
  const KernelCache cache(folder_ / "kernels");
  const auto compiles = [](const std::vector<std::string>& arguments) {
    return run_on_terminal(arguments).find("compiling kernels, once") != std::string::npos;
  };
  // Most kernels of all: they take some seconds on any machine, where those of `metro` can be too fast to be told.
  const std::vector<std::string> arguments{"encode", "y.ply", "y.skeleton.json", "-o", "p.skx.exr", "--size", "64"};
  const bool is_first = compiles(arguments);
  if (cache.files().empty()) GTEST_SKIP() << "the device is none of PoCL's";
  EXPECT_TRUE(is_first);
  EXPECT_FALSE(compiles(arguments));
  fs::remove(folder_ / "p.skx.exr");
  fs::remove_all(folder_ / "kernels");
}

}  // namespace skeletex
