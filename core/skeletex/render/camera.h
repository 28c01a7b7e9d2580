// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// From where to look: angles about the model, or a place of its own.
struct View {
  Vec3 up = Vec3::UnitY(), front = Vec3::UnitZ();  ///< of the model, in its world axes; front is made orthogonal to up
  double azimuth_deg = 30;                         ///< 0: the front is seen; growing: the eye goes to the model's left
  double elevation_deg = 15;
  double fov_deg = 25;                        ///< of the picture's shorter side; 0: orthographic
  double zoom = 1;                            ///< 1: the model fills the picture but for a margin
  std::optional<Vec3> target = std::nullopt;  ///< world; without it the model is centred
  std::optional<Vec3> eye = std::nullopt;     ///< world; with it angles and zoom do not count
};

/// A view from JSON. Its keys are up, front, azimuth, elevation, fov, zoom, target and eye, as the members above; all
/// may be missing.
/// \param where  name of the JSON in messages, for example its path
/// \throw IoError naming a key that is
/// unknown or has no such value
View parse_view(const nlohmann::json& json, const std::string& where);

/// A camera in world space. The axes are orthonormal and right-handed: right, up, back.
struct Camera {
  Vec3 eye = Vec3::Zero(), right = Vec3::UnitX(), up = Vec3::UnitY(), back = Vec3::UnitZ();
  double tan_x = 0.2, tan_y = 0.2;  ///< half the picture's extent at distance 1; orthographic: in world units
  bool is_orthographic = false;
  double near = 0.1, far = 10;
};

/// A camera that shows all points in a picture of the given shape, with 4 % of margin at zoom 1.
/// \throw InputError when up is parallel to the viewing direction's plane of reference, or the eye lies on the target
Camera fit_camera(const View& view, std::span<const Vec3> points, int width, int height);

/// Cameras all the way round the model, of which the first looks as `view` says: about the up axis through the target,
/// without it the middle of the points, all from the same distance, at which the points are in every picture.
/// \param view   has no eye
/// \param count  of cameras, at least 1
/// \throw InputError as fit_camera
std::vector<Camera> turntable(const View& view, std::span<const Vec3> points, int width, int height, int count);

/// World relative to `origin` -> OpenGL clip space.
Eigen::Matrix4d view_projection(const Camera& camera, const Vec3& origin);

}  // namespace skeletex
