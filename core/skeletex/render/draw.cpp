// SPDX-License-Identifier: MIT
#include "skeletex/render/draw.h"

#define GL_GLEXT_PROTOTYPES
#include <GL/glcorearb.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr int kShadowSize = 1024;
constexpr int kKeyShadowSize = 2048;
constexpr int kBatch = 8;  // lights per pass: MAX_LIGHTS of light.frag
constexpr std::array<float, 3> kAmbient{0.13f, 0.13f, 0.14f};

/// Vertex array state, which core profiles want even where there are no attributes.
class VertexArray {
 public:
  VertexArray() { glCreateVertexArrays(1, &id_); }
  ~VertexArray() { glDeleteVertexArrays(1, &id_); }
  VertexArray(const VertexArray&) = delete;
  VertexArray& operator=(const VertexArray&) = delete;
  void bind() const { glBindVertexArray(id_); }
  unsigned id() const { return id_; }

 private:
  unsigned id_ = 0;
};

void set_matrix(int location, const Eigen::Matrix4d& matrix) {
  const Eigen::Matrix4f values = matrix.cast<float>();
  glUniformMatrix4fv(location, 1, GL_FALSE, values.data());
}
void set_vector(int location, const Vec3& v) {
  glUniform3f(location, static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z()));
}

struct Light {
  Vec3 direction;  ///< towards the light
  Vec3 intensity;
};

Light key_light(const Camera& camera) {
  return {(-0.55 * camera.right + 0.65 * camera.up + 0.75 * camera.back).normalized(), Vec3(0.90, 0.88, 0.83)};
}

/// Directions spread evenly (Fibonacci) over the half of the sphere that is up in the picture, so that pictures of
/// models look alike whatever way their own up is, and weakly a little below: light that a floor would send back.
std::vector<Light> sky_light(const Camera& camera, int count) {
  std::vector<Light> lights;
  double total = 0;
  for (int i = 0; i < count; ++i) {
    const double height = (i + 0.5) / count * 1.35 - 0.35;
    const double angle = 2 * std::numbers::pi * 0.6180339887498949 * i, radius = std::sqrt(1 - height * height);
    const Vec3 direction =
        radius * std::cos(angle) * camera.right + height * camera.up + radius * std::sin(angle) * camera.back;
    const double weight = height > 0 ? 1 : 0.45;
    lights.push_back({direction, weight * Vec3(0.94, 0.98, 1.06)});
    total += weight * std::max(0.0, direction.dot(camera.up));
  }
  for (Light& light : lights) light.intensity *= 0.6 / std::max(total, 1e-9);
  return lights;
}

struct Sphere {
  Vec3 centre = Vec3::Zero();
  double radius = 1;
};

Sphere bounding_sphere(const GpuSurface& surface) {
  std::vector<float> values(3 * static_cast<std::size_t>(surface.vertex_count));
  surface.positions.read(values.size() * sizeof(float), values.data());
  if (values.empty()) return {};
  std::vector<Vec3> points;
  for (std::size_t i = 0; i < values.size(); i += 3) points.emplace_back(values[i], values[i + 1], values[i + 2]);
  const BoundingBox box = bounding_box(points);
  return {box.centre(), std::max(0.5 * box.diagonal(), 1e-12)};
}

Eigen::Matrix4d light_projection(const Sphere& bounds, const Vec3& direction) {
  const Vec3 any = std::abs(direction.x()) < 0.7 ? Vec3::UnitX() : Vec3::UnitY();
  const Vec3 right = any.cross(direction).normalized(), up = direction.cross(right);
  const double scale = 1 / (1.01 * bounds.radius);
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.row(0).head<3>() = scale * right;
  matrix.row(1).head<3>() = scale * up;
  matrix.row(2).head<3>() = -scale * direction;
  matrix.col(3).head<3>() = -matrix.topLeftCorner<3, 3>() * bounds.centre;
  return matrix;
}

/// What some lights see: a depth map each.
struct ShadowMaps {
  ShadowMaps(int side, int layers) : size(side), depths(GL_DEPTH_COMPONENT32F, side, side, layers) {
    for (int i = 0; i < layers; ++i) framebuffers.emplace_back(std::span<const unsigned>(), depths.id(), i);
  }
  void draw(GlContext& context, const GpuSurface& surface, std::span<const Light> lights, const Sphere& bounds) const {
    glViewport(0, 0, size, size);
    glEnable(GL_DEPTH_TEST);
    glDisable(GL_BLEND);
    glUseProgram(context.program({"shadow.vert", "shadow.frag"}));
    for (std::size_t i = 0; i < lights.size(); ++i) {
      framebuffers[i].bind();
      glClear(GL_DEPTH_BUFFER_BIT);
      set_matrix(0, light_projection(bounds, lights[i].direction));
      glDrawElements(GL_TRIANGLES, 3 * surface.triangle_count, GL_UNSIGNED_INT, nullptr);
    }
  }
  int size;
  GlTexture depths;
  std::vector<GlFramebuffer> framebuffers;
};

void draw_geometry(GlContext& context, const GpuSurface& surface, const SurfacePaint& paint, const Camera& camera,
                   const DrawOptions& options) {
  glEnable(GL_DEPTH_TEST);
  glDisable(GL_BLEND);
  glDisable(GL_CULL_FACE);
  glClearColor(0, 0, 0, 0);
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  glUseProgram(context.program({"surface.vert", "surface.frag"}));
  surface.positions.bind(0);
  surface.indices.bind(1);
  surface.normals.bind(2);
  // Every binding that the shader names must hold a buffer, read or not.
  (paint.colours.id() != 0 ? paint.colours : surface.indices).bind(3);
  (paint.corner_uv.id() != 0 ? paint.corner_uv : surface.positions).bind(4);
  (paint.triangle_pictures.id() != 0 ? paint.triangle_pictures : surface.indices).bind(5);
  (paint.pictures.id() != 0 ? paint.pictures : surface.indices).bind(6);
  (paint.pixels.id() != 0 ? paint.pixels : surface.indices).bind(7);
  set_matrix(0, view_projection(camera, surface.origin));
  glUniform1i(1, options.is_flat ? 1 : 0);
  glUniform1i(2, static_cast<int>(paint.paint));
  glUniform3f(3, paint.base[0], paint.base[1], paint.base[2]);
  glUniform1f(4, static_cast<float>(options.wire_pixels * options.samples));
  glUniform1f(5, paint.paint == Paint::kNormal ? 0.0f : static_cast<float>(options.lighting));
  glUniform3f(6, 0.02f, 0.025f, 0.03f);
  const Vec3 eye = camera.is_orthographic ? camera.back : Vec3(camera.eye - surface.origin);
  glUniform4f(7, static_cast<float>(eye.x()), static_cast<float>(eye.y()), static_cast<float>(eye.z()),
              camera.is_orthographic ? 0.0f : 1.0f);
  glDrawArrays(GL_TRIANGLES, 0, 3 * surface.triangle_count);
}

/// What is drawn of a surface before it is lit: pictures of one size.
struct GeometryBuffers {
  GeometryBuffers(int width, int height)
      : albedo(GL_RGBA16F, width, height),
        normals(GL_RGBA16F, width, height),
        depth(GL_DEPTH_COMPONENT32F, width, height),
        irradiance(GL_RGBA32F, width, height),
        geometry(std::array{albedo.id(), normals.id()}, depth.id()),
        lighting(std::array{irradiance.id()}, 0) {}
  GlTexture albedo, normals, depth, irradiance;
  GlFramebuffer geometry, lighting;
};

/// Adds the light of the lamps to the irradiance.
class Lamps {
 public:
  Lamps(GlContext& context, const GpuSurface& surface, const Camera& camera, const GeometryBuffers& buffers,
        std::array<int, 2> size)
      : context_(context),
        surface_(surface),
        buffers_(buffers),
        size_(size),
        bounds_(bounding_sphere(surface)),
        unprojection_(view_projection(camera, surface.origin).inverse()) {}

  /// \param taps, spread  of the filter that softens a shadow's edge
  void shine(std::span<const Light> lights, const ShadowMaps& maps, int taps, float spread) const {
    maps.draw(context_, surface_, lights, bounds_);
    buffers_.lighting.bind();
    glViewport(0, 0, size_[0], size_[1]);
    glDisable(GL_DEPTH_TEST);
    glEnable(GL_BLEND);
    glBlendFunc(GL_ONE, GL_ONE);
    glUseProgram(context_.program({"screen.vert", "light.frag"}));
    glBindTextureUnit(0, buffers_.normals.id());
    glBindTextureUnit(1, buffers_.depth.id());
    glBindTextureUnit(2, maps.depths.id());
    set_matrix(0, unprojection_);
    glUniform1i(1, static_cast<int>(lights.size()));
    glUniform1f(2, static_cast<float>((static_cast<float>(taps) * spread + 1) * 2.6 * bounds_.radius / maps.size));
    glUniform1i(3, taps);
    glUniform1f(4, spread);
    for (int i = 0; i < static_cast<int>(lights.size()); ++i) {
      set_matrix(8 + i, light_projection(bounds_, lights[i].direction));
      set_vector(16 + i, lights[i].direction);
      set_vector(24 + i, lights[i].intensity);
    }
    glDrawArrays(GL_TRIANGLES, 0, 3);
  }

 private:
  GlContext& context_;
  const GpuSurface& surface_;
  const GeometryBuffers& buffers_;
  std::array<int, 2> size_;
  Sphere bounds_;
  Eigen::Matrix4d unprojection_;
};

void light_surface(const Lamps& lamps, const GpuSurface& surface, const Camera& camera, int sky_lights,
                   const VertexArray& array) {
  glEnableVertexArrayAttrib(array.id(), 0);
  glVertexArrayVertexBuffer(array.id(), 0, surface.positions.id(), 0, 3 * sizeof(float));
  glVertexArrayAttribFormat(array.id(), 0, 3, GL_FLOAT, GL_FALSE, 0);
  glVertexArrayAttribBinding(array.id(), 0, 0);
  glVertexArrayElementBuffer(array.id(), surface.indices.id());
  lamps.shine(std::array{key_light(camera)}, ShadowMaps(kKeyShadowSize, 1), 2, 1.5f);
  const std::vector<Light> sky = sky_light(camera, sky_lights);
  const ShadowMaps maps(kShadowSize, kBatch);
  for (std::size_t i = 0; i < sky.size(); i += kBatch)
    lamps.shine(std::span(sky).subspan(i, std::min<std::size_t>(kBatch, sky.size() - i)), maps, 0, 0);
  glDisable(GL_BLEND);
}

/// The lit picture, each pixel the mean of its samples.
Image resolve(GlContext& context, const GeometryBuffers& buffers, const DrawOptions& options, int samples) {
  const GlTexture picture(GL_RGBA32F, options.width, options.height);
  const GlFramebuffer resolved(std::array{picture.id()}, 0);
  resolved.bind();
  glViewport(0, 0, options.width, options.height);
  glDisable(GL_DEPTH_TEST);
  glUseProgram(context.program({"screen.vert", "resolve.frag"}));
  glBindTextureUnit(0, buffers.albedo.id());
  glBindTextureUnit(1, buffers.normals.id());
  glBindTextureUnit(2, buffers.irradiance.id());
  glUniform1i(0, samples);
  glUniform3f(1, kAmbient[0], kAmbient[1], kAmbient[2]);
  glDrawArrays(GL_TRIANGLES, 0, 3);

  Image image = make_image(options.width, options.height), flipped = image;
  glReadPixels(0, 0, options.width, options.height, GL_RGBA, GL_FLOAT, flipped.rgba.data());
  check_gl("drawing");
  for (int y = 0; y < image.height; ++y)
    std::copy_n(flipped.at(0, image.height - 1 - y), 4 * static_cast<std::size_t>(image.width), image.at(0, y));
  return image;
}

}  // namespace

GlBuffer upload_colours(std::span<const VertexColour> colours) {
  std::vector<std::array<unsigned char, 4>> bytes;
  bytes.reserve(colours.size());
  for (const VertexColour& c : colours) bytes.push_back({c.r, c.g, c.b, 255});
  return gl_buffer(bytes);
}

SurfacePaint colour_paint(const TriangleMesh& mesh, const MeshAttributes& attributes) {
  SurfacePaint paint;
  paint.paint = Paint::kCorner;
  std::vector<std::array<int, 4>> pictures;
  std::vector<std::uint8_t> pixels;
  for (const Material& material : attributes.materials) {
    pictures.push_back({static_cast<int>(pixels.size() / 4), material.image.width, material.image.height, 0});
    pixels.insert(pixels.end(), material.image.rgba.begin(), material.image.rgba.end());
  }
  std::vector<VertexColour> colours;
  std::vector<Eigen::Vector2f> coordinates;
  std::vector<int> triangle_pictures;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const int material = attributes.triangle_materials.empty() ? -1 : attributes.triangle_materials[t];
    const bool has_picture =
        material >= 0 && !attributes.materials[material].image.empty() && !attributes.texture_coordinates.empty();
    triangle_pictures.push_back(has_picture ? material : -1);
    const Colour base = material < 0 ? Colour(Colour::Ones()) : attributes.materials[material].base;
    for (const int v : mesh.triangles[t]) {
      colours.push_back(
          bytes_of(attributes.colours.empty() ? base : Colour(base.cwiseProduct(attributes.colours.values[v]))));
      coordinates.push_back(has_picture ? attributes.texture_coordinates.values[v] : Eigen::Vector2f(0, 0));
    }
  }
  paint.colours = upload_colours(colours);
  paint.corner_uv = gl_buffer(coordinates);
  paint.triangle_pictures = gl_buffer(triangle_pictures);
  if (!pixels.empty()) {
    paint.pictures = gl_buffer(pictures);
    paint.pixels = gl_buffer(pixels);
  }
  return paint;
}

Image draw(GlContext& context, const GpuSurface& surface, const SurfacePaint& paint, const Camera& camera,
           const DrawOptions& options) {
  GLint largest = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &largest);
  const int samples = std::max(1, options.samples), width = options.width * samples, height = options.height * samples;
  if (width > largest || height > largest)
    throw InputError(
        fmt::format("a picture of {} x {} with {} samples is larger than this device can draw ({} pixels a side); ask "
                    "for a smaller one",
                    options.width, options.height, samples, largest));
  const VertexArray array;
  array.bind();
  const GeometryBuffers buffers(width, height);
  buffers.geometry.bind();
  glViewport(0, 0, width, height);
  draw_geometry(context, surface, paint, camera, options);
  buffers.lighting.bind();
  glClear(GL_COLOR_BUFFER_BIT);
  if (options.lighting > 0 && paint.paint != Paint::kNormal)
    light_surface(Lamps(context, surface, camera, buffers, {width, height}), surface, camera, options.sky_lights,
                  array);
  return resolve(context, buffers, options, samples);
}

}  // namespace skeletex
