// SPDX-License-Identifier: MIT
#pragma once
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace skeletex {

/// A device that EGL offers, in EGL's order.
struct GlDeviceInfo {
  int index = 0;
  std::string name;  ///< its DRM device file, or "software" for Mesa's rasterizer
  bool is_software = false;
};
/// Empty when EGL cannot list devices (then only the default surfaceless one is tried).
std::vector<GlDeviceInfo> list_gl_devices();

/// An OpenGL 4.5 core context without window or display, current on the calling thread as long as it lives. One per
/// thread. Owns the programs; buffers and textures are objects of their own (gl_objects.h) that must not outlive it.
class GlContext {
 public:
  /// \param selector  "" : the first hardware device that works, else software; or a device's number or a part of its
  /// name
  /// \throw DeviceError when there is no such device or it has no OpenGL 4.5
  explicit GlContext(const std::string& selector = "");
  ~GlContext();
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  const std::string& renderer() const { return renderer_; }  ///< GL_RENDERER and GL_VERSION, for records

  /// The program made of shader files of render/shaders, by their endings .vert, .frag, .comp; built once.
  /// \throw DeviceError with the driver's log
  unsigned program(const std::vector<std::string>& files);

 private:
  struct Display;
  std::unique_ptr<Display> display_;
  std::string renderer_;
  std::map<std::vector<std::string>, unsigned> programs_;
};

}  // namespace skeletex
