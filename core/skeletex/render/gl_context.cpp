// SPDX-License-Identifier: MIT
#include "skeletex/render/gl_context.h"

#define EGL_EGLEXT_PROTOTYPES
#define GL_GLEXT_PROTOTYPES
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/glcorearb.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <string_view>

#include "skeletex/device/kernel_source.h"
#include "skeletex/model/error.h"

namespace skeletex {

std::span<const EmbeddedKernelFile> embedded_shader_files();

namespace {

bool has_word(const char* words, std::string_view word) {
  const std::string text = fmt::format(" {} ", words ? words : "");
  return text.find(fmt::format(" {} ", word)) != std::string::npos;
}

std::vector<EGLDeviceEXT> egl_devices() {
  if (!has_word(eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS), "EGL_EXT_device_enumeration") &&
      !has_word(eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS), "EGL_EXT_device_base"))
    return {};
  const auto query = reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
  EGLint count = 0;
  if (!query || !query(0, nullptr, &count)) return {};
  std::vector<EGLDeviceEXT> devices(count);
  if (!query(count, devices.data(), &count)) return {};
  devices.resize(count);
  return devices;
}

GlDeviceInfo describe(int index, EGLDeviceEXT device) {
  const auto query = reinterpret_cast<PFNEGLQUERYDEVICESTRINGEXTPROC>(eglGetProcAddress("eglQueryDeviceStringEXT"));
  const char* extensions = query ? query(device, EGL_EXTENSIONS) : nullptr;
  GlDeviceInfo info{index, "", has_word(extensions, "EGL_MESA_device_software")};
  const char* file =
      query && has_word(extensions, "EGL_EXT_device_drm") ? query(device, EGL_DRM_DEVICE_FILE_EXT) : nullptr;
  info.name = info.is_software ? "software" : file ? file : "device";
  return info;
}

EGLDisplay display_of(EGLDeviceEXT device) {
  const auto get = reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(eglGetProcAddress("eglGetPlatformDisplayEXT"));
  return get ? get(EGL_PLATFORM_DEVICE_EXT, device, nullptr) : EGL_NO_DISPLAY;
}

EGLDisplay surfaceless_display() {
  const auto get = reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(eglGetProcAddress("eglGetPlatformDisplayEXT"));
  if (!get || !has_word(eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS), "EGL_MESA_platform_surfaceless"))
    return EGL_NO_DISPLAY;
  return get(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
}

std::string_view embedded_text(std::string_view file) {
  for (const EmbeddedKernelFile& embedded : embedded_shader_files())
    if (embedded.name == file) return embedded.text;
  throw DeviceError(fmt::format("there is no shader {}", file));
}

/// A shader's text, with headers in place of its lines `#include "x.h"`.
std::string shader_text(std::string_view file) {
  constexpr std::string_view kInclude = "\n#include \"";
  std::string text(embedded_text(file));
  for (std::size_t at; (at = text.find(kInclude)) != std::string::npos;) {
    const std::size_t name = at + kInclude.size(), end = text.find('"', name);
    const std::string header(embedded_text(text.substr(name, end - name)));
    text.replace(at + 1, end - at, header);
  }
  return text;
}

GLenum stage_of(const std::string& file) {
  return file.ends_with(".vert") ? GL_VERTEX_SHADER : file.ends_with(".frag") ? GL_FRAGMENT_SHADER : GL_COMPUTE_SHADER;
}

}  // namespace

struct GlContext::Display {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;

  ~Display() { close(); }
  void close() {
    if (display == EGL_NO_DISPLAY) return;
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context != EGL_NO_CONTEXT) eglDestroyContext(display, context);
    context = EGL_NO_CONTEXT;
    display = EGL_NO_DISPLAY;  // not terminated: other contexts of the process may use the same display
  }
  /// Why it did not work, or "".
  std::string open(EGLDisplay candidate) {
    display = candidate;
    if (display == EGL_NO_DISPLAY) return "no display";
    if (!eglInitialize(display, nullptr, nullptr)) return "EGL does not start";
    if (!eglBindAPI(EGL_OPENGL_API)) return "no desktop OpenGL";
    const EGLint wanted[] = {EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint count = 0;
    if (!eglChooseConfig(display, wanted, &config, 1, &count) || count < 1) return "no configuration with OpenGL";
    const EGLint attributes[] = {
        EGL_CONTEXT_MAJOR_VERSION,           4,       EGL_CONTEXT_MINOR_VERSION, 5, EGL_CONTEXT_OPENGL_PROFILE_MASK,
        EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
    context = eglCreateContext(display, config, EGL_NO_CONTEXT, attributes);
    if (context == EGL_NO_CONTEXT) return "no OpenGL 4.5";
    if (!eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) return "no context without a surface";
    return "";
  }
};

std::vector<GlDeviceInfo> list_gl_devices() {
  std::vector<GlDeviceInfo> list;
  const std::vector<EGLDeviceEXT> devices = egl_devices();
  for (std::size_t i = 0; i < devices.size(); ++i) list.push_back(describe(static_cast<int>(i), devices[i]));
  return list;
}

GlContext::GlContext(const std::string& selector) : display_(std::make_unique<Display>()) {
  const std::vector<EGLDeviceEXT> devices = egl_devices();
  std::vector<GlDeviceInfo> chosen = list_gl_devices();
  std::string names;
  for (const GlDeviceInfo& device : chosen)
    names += fmt::format("{}{}: {}", names.empty() ? "" : ", ", device.index, device.name);
  if (!selector.empty()) {
    const bool is_number =
        std::all_of(selector.begin(), selector.end(), [](unsigned char c) { return std::isdigit(c); });
    std::erase_if(chosen, [&](const GlDeviceInfo& device) {
      return is_number ? std::to_string(device.index) != selector : device.name.find(selector) == std::string::npos;
    });
    if (chosen.empty())
      throw DeviceError(fmt::format("no EGL device \"{}\"; there are: {}", selector, names.empty() ? "none" : names));
  }
  std::stable_partition(chosen.begin(), chosen.end(), [](const GlDeviceInfo& device) { return !device.is_software; });
  std::string reasons;
  bool is_open = false;
  for (const GlDeviceInfo& device : chosen) {
    const std::string reason = display_->open(display_of(devices[device.index]));
    is_open = reason.empty();
    if (is_open) break;
    reasons += fmt::format("\n  {}: {}", device.name, reason);
    display_->close();
  }
  if (!is_open && selector.empty()) {
    const std::string reason = display_->open(surfaceless_display());
    is_open = reason.empty();
    if (!is_open) reasons += fmt::format("\n  surfaceless: {}", reason);
  }
  if (!is_open)
    throw DeviceError(
        fmt::format("no EGL device gives an OpenGL 4.5 context:{}\nMesa's software device (Debian packages libegl1 and "
                    "libgl1-mesa-dri) does.",
                    reasons));
  const auto text = [](GLenum name) { return std::string(reinterpret_cast<const char*>(glGetString(name))); };
  renderer_ = fmt::format("{}, OpenGL {}", text(GL_RENDERER), text(GL_VERSION));
}

GlContext::~GlContext() {
  for (const auto& [files, program] : programs_) glDeleteProgram(program);
}

unsigned GlContext::program(const std::vector<std::string>& files) {
  if (const auto found = programs_.find(files); found != programs_.end()) return found->second;
  const GLuint program = glCreateProgram();
  std::vector<char> log(16384);
  GLint is_good = 0;
  for (const std::string& file : files) {
    const GLuint shader = glCreateShader(stage_of(file));
    const std::string text = shader_text(file);
    const char* begin = text.data();
    const auto length = static_cast<GLint>(text.size());
    glShaderSource(shader, 1, &begin, &length);
    glCompileShader(shader);
    glGetShaderiv(shader, GL_COMPILE_STATUS, &is_good);
    if (!is_good) {
      glGetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), nullptr, log.data());
      throw DeviceError(fmt::format("shader {} does not compile on {}:\n{}", file, renderer_, log.data()));
    }
    glAttachShader(program, shader);
    glDeleteShader(shader);
  }
  glLinkProgram(program);
  glGetProgramiv(program, GL_LINK_STATUS, &is_good);
  if (!is_good) {
    glGetProgramInfoLog(program, static_cast<GLsizei>(log.size()), nullptr, log.data());
    throw DeviceError(fmt::format("shaders {} do not link on {}:\n{}", fmt::join(files, " + "), renderer_, log.data()));
  }
  programs_.emplace(files, program);
  return program;
}

}  // namespace skeletex
