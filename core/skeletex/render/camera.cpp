// SPDX-License-Identifier: MIT
#include "skeletex/render/camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr double kMargin = 0.04;
constexpr double kRadians = std::numbers::pi / 180;

Vec3 vector_of(const nlohmann::json& json, const std::string& where) {
  if (!json.is_array() || json.size() != 3 ||
      !std::all_of(json.begin(), json.end(), [](const auto& x) { return x.is_number(); }))
    throw IoError(fmt::format("{} must be three numbers", where));
  return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()};
}

}  // namespace

View parse_view(const nlohmann::json& json, const std::string& source) {
  if (!json.is_object())
    throw IoError(fmt::format("{}: a view is an object like {{\"azimuth\": 30, \"elevation\": 15}}", source));
  View view;
  for (const auto& [key, value] : json.items()) {
    const std::string where = fmt::format("{}: \"{}\"", source, key);
    const auto number = [&, &value = value](double lowest, double highest) {
      if (!value.is_number()) throw IoError(where + " must be a number");
      const double x = value.get<double>();
      if (!(x >= lowest && x <= highest))
        throw IoError(fmt::format("{} is {}, not within {} to {}", where, x, lowest, highest));
      return x;
    };
    if (key == "azimuth")
      view.azimuth_deg = number(-3600, 3600);
    else if (key == "elevation")
      view.elevation_deg = number(-90, 90);
    else if (key == "fov")
      view.fov_deg = number(0, 120);
    else if (key == "zoom")
      view.zoom = number(0.01, 1000);
    else if (key == "up")
      view.up = vector_of(value, where);
    else if (key == "front")
      view.front = vector_of(value, where);
    else if (key == "target")
      view.target = vector_of(value, where);
    else if (key == "eye")
      view.eye = vector_of(value, where);
    else
      throw IoError(fmt::format(
          "{} is no part of a view; there are azimuth, elevation, fov, zoom, up, front, target and eye", where));
  }
  return view;
}

namespace {

/// Places a camera, whose axes and opening are set, so that all points are in its picture.
class CameraFit {
 public:
  /// \param radius  half the diagonal of the points' box
  CameraFit(const View& view, std::span<const Vec3> points, double radius, const Vec3& target, Camera& camera)
      : view_(view), points_(points), radius_(radius), target_(target), camera_(camera) {}

  void run() {
    if (view_.eye)
      keep_eye();
    else if (camera_.is_orthographic)
      fit_orthographic();
    else
      fit_perspective();
  }

 private:
  static constexpr double kUsable = 1 - 2 * kMargin;

  /// As the camera sees it, about the target.
  Vec3 seen(const Vec3& p) const {
    return {camera_.right.dot(p - target_), camera_.up.dot(p - target_), camera_.back.dot(p - target_)};
  }

  void keep_eye() {
    camera_.eye = *view_.eye;
    if (!camera_.is_orthographic) return;
    double scale = 1e-12;
    for (const Vec3& p : points_)
      scale = std::max({scale, std::abs(seen(p).x()) / camera_.tan_x, std::abs(seen(p).y()) / camera_.tan_y});
    camera_.tan_x *= scale / kUsable;
    camera_.tan_y *= scale / kUsable;
  }

  void fit_orthographic() {
    std::vector<Vec3> places;
    for (const Vec3& p : points_) places.push_back(seen(p));
    const auto [low, high] = bounding_box(places);
    Vec3 half = 0.5 * (high - low);
    if (view_.target)
      half = high.cwiseMax(-low);
    else
      target_ += 0.5 * (low.x() + high.x()) * camera_.right + 0.5 * (low.y() + high.y()) * camera_.up;
    const double scale = std::max({half.x() / camera_.tan_x, half.y() / camera_.tan_y, 1e-12}) / kUsable / view_.zoom;
    camera_.tan_x *= scale;
    camera_.tan_y *= scale;
    camera_.eye = target_ + 3 * radius_ * camera_.back;
  }

  /// The pyramid through a point meets the axis at z + |x| / tan. Its four sides fix the tightest eye and its shift.
  void fit_perspective() {
    double distance = 0;
    for (int pass = 0; pass < 8; ++pass) {
      double left_most = -1e300, right_most = -1e300, top = -1e300, bottom = -1e300;
      for (const Vec3& p : points_) {
        const Vec3 q = seen(p);
        right_most = std::max(right_most, q.x() + q.z() * camera_.tan_x * kUsable);
        left_most = std::max(left_most, -q.x() + q.z() * camera_.tan_x * kUsable);
        top = std::max(top, q.y() + q.z() * camera_.tan_y * kUsable);
        bottom = std::max(bottom, -q.y() + q.z() * camera_.tan_y * kUsable);
      }
      if (points_.empty()) left_most = right_most = top = bottom = radius_;
      if (view_.target) {
        distance = std::max(std::max(right_most, left_most) / (camera_.tan_x * kUsable),
                            std::max(top, bottom) / (camera_.tan_y * kUsable));
        break;
      }
      target_ += 0.5 * (right_most - left_most) * camera_.right + 0.5 * (top - bottom) * camera_.up;
      distance = std::max(0.5 * (right_most + left_most) / (camera_.tan_x * kUsable),
                          0.5 * (top + bottom) / (camera_.tan_y * kUsable));
    }
    camera_.eye = target_ + distance * camera_.back;
    camera_.tan_x /= view_.zoom;
    camera_.tan_y /= view_.zoom;
  }

  const View& view_;
  std::span<const Vec3> points_;
  double radius_;
  Vec3 target_;
  Camera& camera_;
};

/// Sets the camera's axes.
void turn_camera(const View& view, const Vec3& target, Camera& camera) {
  if (!(view.up.norm() > 0)) throw InputError("the view's up direction has no length");
  const Vec3 up = view.up.normalized();
  Vec3 front = view.front - up * up.dot(view.front);
  if (!(front.norm() > 1e-9 * view.front.norm()))
    throw InputError("the view's front direction must not be parallel to its up direction");
  front.normalize();
  const Vec3 left = up.cross(front);
  const double azimuth = view.azimuth_deg * kRadians, elevation = view.elevation_deg * kRadians;
  const Vec3 sideways = std::cos(azimuth) * front + std::sin(azimuth) * left;
  camera.back = std::cos(elevation) * sideways + std::sin(elevation) * up;
  if (view.eye) {
    camera.back = *view.eye - target;
    if (!(camera.back.norm() > 0)) throw InputError("the view's eye lies on its target");
    camera.back.normalize();
  }
  camera.right = up.cross(camera.back);
  if (camera.right.norm() < 1e-9) camera.right = -sideways.cross(up);  // from straight above or below
  camera.right.normalize();
  camera.up = camera.back.cross(camera.right);
}

}  // namespace

Camera fit_camera(const View& view, std::span<const Vec3> points, int width, int height) {
  const auto [lower, upper] = bounding_box(points);
  const double radius = std::max(0.5 * (upper - lower).norm(), 1e-12);
  const Vec3 target = view.target.value_or(0.5 * (lower + upper));
  Camera camera;
  turn_camera(view, target, camera);
  camera.is_orthographic = view.fov_deg == 0;
  const double aspect = static_cast<double>(width) / height;
  const double half = camera.is_orthographic ? 1 : std::tan(0.5 * view.fov_deg * kRadians);
  camera.tan_x = aspect >= 1 ? half * aspect : half;
  camera.tan_y = aspect >= 1 ? half : half / aspect;
  CameraFit(view, points, radius, target, camera).run();

  double nearest = std::numeric_limits<double>::infinity(), farthest = 0;
  for (const Vec3& p : points) {
    const double depth = camera.back.dot(camera.eye - p);
    nearest = std::min(nearest, depth);
    farthest = std::max(farthest, depth);
  }
  camera.far = std::max(farthest, radius) + 0.05 * radius;
  camera.near = std::max(std::min(nearest, camera.far) - 0.05 * radius, 1e-3 * camera.far);
  return camera;
}

std::vector<Camera> turntable(const View& view, std::span<const Vec3> points, int width, int height, int count) {
  const auto [lower, upper] = bounding_box(points);
  View turned = view;
  turned.target = view.target.value_or(0.5 * (lower + upper));
  std::vector<Camera> cameras;
  double distance = 0, nearest = std::numeric_limits<double>::infinity();
  Camera widest;
  for (int i = 0; i < count; ++i) {
    turned.azimuth_deg = view.azimuth_deg + 360.0 * i / count;
    cameras.push_back(fit_camera(turned, points, width, height));
    const Camera& camera = cameras.back();
    const double own = (camera.eye - *turned.target).norm();
    distance = std::max(distance, own);
    // Relative to the target.
    nearest = std::min(nearest, camera.near - own);
    widest.far = i == 0 ? camera.far - own : std::max(widest.far, camera.far - own);
    widest.tan_x = i == 0 ? camera.tan_x : std::max(widest.tan_x, camera.tan_x);
    widest.tan_y = i == 0 ? camera.tan_y : std::max(widest.tan_y, camera.tan_y);
  }
  for (Camera& camera : cameras) {
    camera.eye = *turned.target + distance * camera.back;
    camera.tan_x = widest.tan_x;
    camera.tan_y = widest.tan_y;
    camera.far = distance + widest.far;
    camera.near = std::max(distance + nearest, 1e-3 * camera.far);
  }
  return cameras;
}

Eigen::Matrix4d view_projection(const Camera& camera, const Vec3& origin) {
  Eigen::Matrix4d view = Eigen::Matrix4d::Identity();
  view.row(0).head<3>() = camera.right;
  view.row(1).head<3>() = camera.up;
  view.row(2).head<3>() = camera.back;
  view.col(3).head<3>() = view.topLeftCorner<3, 3>() * (origin - camera.eye);
  Eigen::Matrix4d projection = Eigen::Matrix4d::Zero();
  const double depth = camera.far - camera.near;
  projection(0, 0) = 1 / camera.tan_x;
  projection(1, 1) = 1 / camera.tan_y;
  if (camera.is_orthographic) {
    projection(2, 2) = -2 / depth;
    projection(2, 3) = -(camera.far + camera.near) / depth;
    projection(3, 3) = 1;
  } else {
    projection(2, 2) = -(camera.far + camera.near) / depth;
    projection(2, 3) = -2 * camera.far * camera.near / depth;
    projection(3, 2) = -1;
  }
  return projection * view;
}

}  // namespace skeletex
