// SPDX-License-Identifier: MIT
// A skeleton with every node moved at random: what `validate --repair` is measured with.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "skeletex/io/atomic_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/io/same_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/skeletonize/repair.h"

namespace {

using namespace skeletex;

struct Arguments {
  std::string mesh, skeleton, output;
  double by = 0.05;
  unsigned seed = 0;
};

void run(const Arguments& arguments) {
  check_not_an_input(arguments.output, {arguments.mesh, arguments.skeleton});
  const double largest = arguments.by * bounding_box(read_mesh(arguments.mesh).mesh).diagonal();
  Skeleton skeleton = read_skeleton(arguments.skeleton);
  RandomNumbers random(arguments.seed);
  for (Node& node : skeleton.nodes) node.position += random.in_ball(largest);
  write_text_atomically(arguments.output, skeleton_to_json(skeleton).dump(1) + "\n");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("Moves every node of a skeleton at random.", "spoil_skeleton");
  Arguments arguments;
  program.add_option("MESH", arguments.mesh, "the skeleton's mesh")->required();
  program.add_option("SKELETON", arguments.skeleton, "the skeleton")->required();
  program.add_option("-o,--output", arguments.output, "the result: .json")->required();
  program.add_option("--by", arguments.by, "how far at most, in diagonals of the mesh's bounding box")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  program.add_option("--seed", arguments.seed, "the same number moves nodes the same way")->capture_default_str();
  try {
    program.parse(argc, argv);
    run(arguments);
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 1;
  }
}
