// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <optional>

#include <nlohmann/json.hpp>

#include "skeletex/model/texture.h"

namespace skeletex {

enum class TexelFormat { kFloat, kHalf };
enum class ExrCompression { kZip, kPiz };

struct ModelFileOptions {
  TexelFormat format = TexelFormat::kFloat;
  ExrCompression compression = ExrCompression::kZip;
};

/// Writes a model as one OpenEXR file: channels R (along), G (around), B (out), and the string attribute
/// "skeletex" with a versioned JSON object that holds everything else. Atomic; the same model gives the same bytes.
/// \throw IoError
void write_model(const std::filesystem::path& path, const SkeletexModel& model, const ModelFileOptions& options = {});

/// \throw IoError: not an EXR, truncated, no skeletex attribute, a newer version, or contents that do not fit together
/// (every index, size and number is checked before use)
SkeletexModel read_model(const std::filesystem::path& path);

/// The header's JSON alone, without reading texels, for `skeletex inspect`.
nlohmann::json read_model_header(const std::filesystem::path& path);

}  // namespace skeletex
