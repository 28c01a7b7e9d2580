// SPDX-License-Identifier: MIT
#include "view_options.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "files.h"
#include "skeletex/io/json_file.h"
#include "skeletex/io/read_file.h"

namespace skeletex::cli {
namespace {

struct Side {
  const char* name;
  double azimuth_deg, elevation_deg;
};
constexpr std::array kSides{Side{"front", 0, 0},   Side{"back", 180, 0}, Side{"left", 90, 0},
                            Side{"right", -90, 0}, Side{"top", 0, 90},   Side{"bottom", 0, -90}};
constexpr std::array kAxes{"+x", "-x", "+y", "-y", "+z", "-z"};

/// Looks at a side of the model, or from the end of an axis.
void look_from(const std::string& side, View& view) {
  view.eye.reset();
  const auto found = std::find_if(kSides.begin(), kSides.end(), [&](const Side& one) { return side == one.name; });
  if (found != kSides.end()) {
    view.azimuth_deg = found->azimuth_deg;
    view.elevation_deg = found->elevation_deg;
    return;
  }
  constexpr double kDegrees = 180 / std::numbers::pi;
  const Vec3 axis = parse_direction("--view", side), up = view.up.normalized();
  const Vec3 front = (view.front - up * up.dot(view.front)).normalized();
  view.elevation_deg = std::asin(std::clamp(axis.dot(up), -1.0, 1.0)) * kDegrees;
  const bool is_vertical = std::abs(axis.dot(up)) > 1 - 1e-12;
  view.azimuth_deg = is_vertical ? 0 : std::atan2(axis.dot(up.cross(front)), axis.dot(front)) * kDegrees;
}

}  // namespace

void add_view_options(CLI::App& command, ViewArguments& arguments) {
  CLI::Option* camera =
      declare_input(command,
                    command.add_option("--camera", arguments.camera,
                                       "view: .json with azimuth, elevation, fov, zoom, up, front, target, eye"))
          ->type_name("FILE");
  CLI::Option* azimuth =
      command.add_option("--azimuth", arguments.azimuth, "degrees about the up axis, 0 from the front (default: 30)")
          ->check(any_number())
          ->type_name("DEG");
  CLI::Option* elevation =
      command.add_option("--elevation", arguments.elevation, "degrees above the horizon (default: 15)")
          ->check(number_in(-90.0, 90.0))
          ->type_name("DEG");
  std::vector<std::string> sides;
  for (const Side& side : kSides) sides.emplace_back(side.name);
  sides.insert(sides.end(), kAxes.begin(), kAxes.end());
  CLI::Option* side = command.add_option(
      "--view", arguments.side, "the side that is seen, as the model stands; or the axis that points at the eye");
  take_one_of(*side, sides);
  for (CLI::Option* other : {camera, azimuth, elevation}) side->excludes(other);
  command.add_option("--fov", arguments.fov, "degrees of the shorter side, 0: orthographic (default: 25)")
      ->check(number_in(0.0, 120.0))
      ->type_name("DEG");
  command.add_option("--zoom", arguments.zoom, "1: the model fills the picture")
      ->check(number_in(0.01, 1000.0))
      ->type_name("X");
  command.add_option("--up", arguments.up, "the model's up direction (default: its own, else y)")
      ->type_name("x|-y|..|X,Y,Z");
  command.add_option("--front", arguments.front, "where the model looks (default: its own, else z)")
      ->type_name("x|-y|..|X,Y,Z");
  CLI::Option* views = command.add_option("--views", arguments.views, "pictures side by side, all the way round")
                           ->check(number_in(1, 24))
                           ->type_name("N");
  command
      .add_option("--turntable", arguments.turntable,
                  "so many pictures all the way round, from the same distance: out_000.png, out_001.png ..")
      ->check(number_in(2, 3600))
      ->type_name("N")
      ->excludes(views);
}

View view_of(const ViewArguments& arguments, const nlohmann::json& own_view, const std::string& where,
             const std::optional<Stance>& stance) {
  View view;
  if (stance) view.up = stance->up, view.front = stance->front;
  if (!own_view.is_null()) view = parse_view(own_view, where);
  if (!arguments.camera.empty())
    view = parse_view(parse_json(read_file(arguments.camera), arguments.camera), arguments.camera);
  if (!arguments.up.empty()) view.up = parse_direction("--up", arguments.up);
  if (!arguments.front.empty()) view.front = parse_direction("--front", arguments.front);
  // A model that stands along z looks along -y, as most tools that have z up have it.
  else if (view.up.normalized().cross(view.front).norm() < 1e-9)
    view.front = -Vec3::UnitY();
  if (!arguments.side.empty()) look_from(arguments.side, view);
  view.azimuth_deg = arguments.azimuth.value_or(view.azimuth_deg);
  view.elevation_deg = arguments.elevation.value_or(view.elevation_deg);
  view.fov_deg = arguments.fov.value_or(view.fov_deg);
  view.zoom = arguments.zoom.value_or(view.zoom);
  if (view.eye && arguments.turntable > 0)
    throw CLI::ValidationError("--turntable", "turns by the azimuth; a view with an \"eye\" has none");
  return view;
}

std::vector<std::vector<Camera>> cameras_of(const ViewArguments& arguments, const View& view,
                                            std::span<const Vec3> points, int width, int height) {
  std::vector<std::vector<Camera>> pictures;
  if (arguments.turntable > 0) {
    for (const Camera& camera : turntable(view, points, width, height, arguments.turntable))
      pictures.push_back({camera});
    return pictures;
  }
  pictures.emplace_back();
  View turned = view;
  for (int i = 0; i < arguments.views; ++i) {
    turned.azimuth_deg = view.azimuth_deg + 360.0 * i / arguments.views;
    pictures[0].push_back(fit_camera(turned, points, width, height));
  }
  return pictures;
}

}  // namespace skeletex::cli
