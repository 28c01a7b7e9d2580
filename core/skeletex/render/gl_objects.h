// SPDX-License-Identifier: MIT
#pragma once
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace skeletex {

/// A buffer on the GL device. Move-only; must not outlive its GlContext.
class GlBuffer {
 public:
  GlBuffer() = default;
  explicit GlBuffer(std::size_t bytes, const void* data = nullptr);
  ~GlBuffer();
  GlBuffer(GlBuffer&& other) noexcept : id_(std::exchange(other.id_, 0)), bytes_(std::exchange(other.bytes_, 0)) {}
  GlBuffer& operator=(GlBuffer&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  unsigned id() const { return id_; }
  std::size_t bytes() const { return bytes_; }
  void write(std::size_t offset, std::size_t bytes, const void* data);
  void read(std::size_t bytes, void* data) const;
  /// As shader storage at a binding point.
  void bind(unsigned binding) const;

 private:
  unsigned id_ = 0;
  std::size_t bytes_ = 0;
};

template <typename T>
GlBuffer gl_buffer(std::span<const T> values) {
  return GlBuffer(values.size_bytes(), values.data());
}
template <typename T>
GlBuffer gl_buffer(const std::vector<T>& values) {
  return gl_buffer(std::span<const T>(values));
}

/// A 2D texture, or an array of them, without mip levels. Move-only.
class GlTexture {
 public:
  GlTexture() = default;
  /// \param format  sized internal format, e.g. GL_RGBA16F
  /// \param layers  0: a plain texture, else an array
  GlTexture(unsigned format, int width, int height, int layers = 0);
  ~GlTexture();
  GlTexture(GlTexture&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  GlTexture& operator=(GlTexture&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  unsigned id() const { return id_; }

 private:
  unsigned id_ = 0;
};

/// Textures to draw into: colours at locations 0, 1, ... and depth. The textures stay the caller's.
class GlFramebuffer {
 public:
  /// \param layer  of the depth texture, when that is an array
  /// \throw DeviceError when the device cannot draw into these
  GlFramebuffer(std::span<const unsigned> colours, unsigned depth, int layer = -1);
  ~GlFramebuffer();
  GlFramebuffer(GlFramebuffer&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  GlFramebuffer& operator=(GlFramebuffer&&) = delete;
  void bind() const;

 private:
  unsigned id_ = 0;
};

/// \throw DeviceError naming `what` when GL has recorded an error (out of memory, most of all)
void check_gl(const char* what);

}  // namespace skeletex
