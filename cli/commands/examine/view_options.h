// SPDX-License-Identifier: MIT
#pragma once
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "command.h"
#include "skeletex/model/texture.h"
#include "skeletex/render/camera.h"

namespace skeletex::cli {

/// From where `render` looks, as the user says it.
struct ViewArguments {
  std::string camera, up, front, side;
  std::optional<double> azimuth, elevation, fov, zoom;
  int views = 1;      ///< in one picture
  int turntable = 0;  ///< pictures; 0: one
};

/// --camera, --view, --azimuth, --elevation, --fov, --zoom, --up, --front, --views and --turntable.
void add_view_options(CLI::App& command, ViewArguments& arguments);

/// \param own_view  of the input file; null: none
/// \param where     its name, for messages
/// \param stance    of the model; a view that the user names comes before it
/// \throw CLI::ValidationError, IoError, InputError
View view_of(const ViewArguments& arguments, const nlohmann::json& own_view, const std::string& where,
             const std::optional<Stance>& stance);

/// The cameras of each picture: one picture of one or several views, or those of a turntable.
/// \param width  of one view, pixels
std::vector<std::vector<Camera>> cameras_of(const ViewArguments& arguments, const View& view,
                                            std::span<const Vec3> points, int width, int height);

}  // namespace skeletex::cli
