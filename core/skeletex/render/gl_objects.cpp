// SPDX-License-Identifier: MIT
#include "skeletex/render/gl_objects.h"

#define GL_GLEXT_PROTOTYPES
#include <GL/glcorearb.h>
#include <fmt/format.h>

#include "skeletex/model/error.h"

namespace skeletex {

GlBuffer::GlBuffer(std::size_t bytes, const void* data) : bytes_(bytes) {
  glCreateBuffers(1, &id_);
  glNamedBufferData(id_, static_cast<GLsizeiptr>(bytes > 0 ? bytes : 4), data, GL_DYNAMIC_DRAW);
  check_gl("a buffer");
}
GlBuffer::~GlBuffer() {
  if (id_ != 0) glDeleteBuffers(1, &id_);
}
void GlBuffer::write(std::size_t offset, std::size_t bytes, const void* data) {
  glNamedBufferSubData(id_, static_cast<GLintptr>(offset), static_cast<GLsizeiptr>(bytes), data);
}
void GlBuffer::read(std::size_t bytes, void* data) const {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glGetNamedBufferSubData(id_, 0, static_cast<GLsizeiptr>(bytes), data);
}
void GlBuffer::bind(unsigned binding) const { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, binding, id_); }

GlTexture::GlTexture(unsigned format, int width, int height, int layers) {
  glCreateTextures(layers > 0 ? GL_TEXTURE_2D_ARRAY : GL_TEXTURE_2D, 1, &id_);
  if (layers > 0)
    glTextureStorage3D(id_, 1, format, width, height, layers);
  else
    glTextureStorage2D(id_, 1, format, width, height);
  for (const GLenum axis : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T}) glTextureParameteri(id_, axis, GL_CLAMP_TO_EDGE);
  for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTextureParameteri(id_, filter, GL_NEAREST);
  check_gl("a texture");
}
GlTexture::~GlTexture() {
  if (id_ != 0) glDeleteTextures(1, &id_);
}

GlFramebuffer::GlFramebuffer(std::span<const unsigned> colours, unsigned depth, int layer) {
  glCreateFramebuffers(1, &id_);
  std::vector<GLenum> targets;
  for (const unsigned colour : colours) {
    targets.push_back(GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(targets.size()));
    glNamedFramebufferTexture(id_, targets.back(), colour, 0);
  }
  if (layer >= 0)
    glNamedFramebufferTextureLayer(id_, GL_DEPTH_ATTACHMENT, depth, 0, layer);
  else if (depth != 0)
    glNamedFramebufferTexture(id_, GL_DEPTH_ATTACHMENT, depth, 0);
  glNamedFramebufferDrawBuffers(id_, static_cast<GLsizei>(targets.size()), targets.data());
  if (glCheckNamedFramebufferStatus(id_, GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    glDeleteFramebuffers(1, &id_);
    throw DeviceError("OpenGL cannot draw into textures of this kind");
  }
}
GlFramebuffer::~GlFramebuffer() {
  if (id_ != 0) glDeleteFramebuffers(1, &id_);
}
void GlFramebuffer::bind() const { glBindFramebuffer(GL_FRAMEBUFFER, id_); }

void check_gl(const char* what) {
  const GLenum code = glGetError();
  if (code == GL_NO_ERROR) return;
  if (code == GL_OUT_OF_MEMORY)
    throw DeviceError(fmt::format("OpenGL has no memory for {}; ask for a smaller picture or model", what));
  throw DeviceError(fmt::format("OpenGL error {:#x} with {}", code, what));
}

}  // namespace skeletex
