// SPDX-License-Identifier: MIT
#pragma once
#include <CLI/CLI.hpp>
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/device/stopwatch.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/skeleton/skeleton.h"

/// The program `skeletex`: one file per command, each adds itself to the program and runs as its callback. Results go
/// to standard output, everything else to standard error.
namespace skeletex::cli {

using Json = nlohmann::ordered_json;

void add_encode_command(CLI::App& program);
void add_skeletonize_command(CLI::App& program);
void add_reconstruct_command(CLI::App& program);
void add_correspond_command(CLI::App& program);
void add_morph_command(CLI::App& program);
void add_filter_command(CLI::App& program);
void add_lod_command(CLI::App& program);
void add_pack_command(CLI::App& program);
void add_unpack_command(CLI::App& program);
void add_export_command(CLI::App& program);
void add_import_command(CLI::App& program);
void add_pose_random_command(CLI::App& program);
void add_weights_command(CLI::App& program);
void add_transfer_command(CLI::App& program);
void add_metro_command(CLI::App& program);
void add_segment_command(CLI::App& program);
void add_validate_command(CLI::App& program);
void add_inspect_command(CLI::App& program);
void add_devices_command(CLI::App& program);
void add_help_command(CLI::App& program);
void add_completions_command(CLI::App& program);
void add_manual_command(CLI::App& program);
void add_render_command(CLI::App& program);
void add_view_command(CLI::App& program);
void add_bench_command(CLI::App& program);
void add_run_command(CLI::App& program);
void add_collect_command(CLI::App& program);
void add_replay_command(CLI::App& program);

/// All commands, in the order of the help. Each has its files checked (files.h) before it runs.
void add_commands(CLI::App& program);

/// Exit code of the process when what a command found is bad news, but no error: `throw CLI::RuntimeError(kExitBad)`.
constexpr int kExitBad = 1;
constexpr int kExitUsage = 2;

void add_device_option(CLI::App& command, std::string& selector);
/// --json FILE or -; with "-" the command prints nothing else to standard output.
void add_json_option(CLI::App& command, std::string& target);
/// The option takes one of a few words; the message about another one names the nearest.
void take_one_of(CLI::Option& option, const std::vector<std::string>& words);
/// The names of the commands that the program has by now, in the order of the help.
std::vector<std::string> command_names(const CLI::App& program);
/// The option takes one of command_names.
void take_command(CLI::Option& option, const CLI::App& program);
/// \throw CLI::ExtrasError that names the nearest command when there is none of this name
void check_command(const CLI::App& program, const std::string& name);
/// \return the words of take_one_of and take_command; none where the option takes others
std::vector<std::string> words_of(const CLI::Option& option);
/// Writes to the file (atomically) or, for "-", to standard output. Does nothing for "".
void write_json(const std::string& target, const Json& json);

/// Prints to standard output unless the JSON goes there.
void print(const std::string& json_target, const std::string& text);
void warn(const std::string& text);

/// Fails before the work rather than after it.
/// \throw IoError when the folder of `path` is missing or not writable
void check_output(const std::filesystem::path& path);

/// Reads a mesh, and says on standard error what the reader did to it (polygons split, vertices welded).
TriangleMesh load_mesh(const std::filesystem::path& path);
/// The same with its attributes and, unless they are not of interest, its materials and their pictures; says which of
/// these are missing.
MeshFile load_mesh_file(const std::filesystem::path& path, bool has_materials = true);
/// Checks that mesh and skeleton fit (validate_before_segmentation, which turns a mesh that is inside out) and prints
/// every finding to standard error.
/// \throw CLI::RuntimeError(kExitBad) when one is an error
void require_valid(TriangleMesh& mesh, const Skeleton& skeleton, std::optional<TriangleTree>* tree = nullptr);
/// The same for a mesh alone, which has to be closed and in one piece.
/// \return the tree of its triangles
TriangleTree require_closed(TriangleMesh& mesh);

/// A direction as an option gives it: x, -y, .. or three numbers with commas between them.
/// \throw CLI::ValidationError
Vec3 parse_direction(const char* option, const std::string& text);

/// Width and height that --size gives as N or WIDTHxHEIGHT.
/// \param unit  what is counted, such as "pixels"
/// \throw CLI::ValidationError unless both are in the range
std::array<int, 2> parse_size(const std::string& text, int least, int most, std::string_view unit);

/// Time on the device by kernel, for the JSON.
Json profile_json(ClContext& context);

}  // namespace skeletex::cli
