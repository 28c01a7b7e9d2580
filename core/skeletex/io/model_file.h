// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <vector>

#include "skeletex/model/texture.h"

namespace skeletex {

enum class TexelFormat { kFloat, kHalf };
/// kAuto: ZIP where it pays. Of float texels in small textures it may save a thirtieth, and takes a sixth of the time
/// of encoding.
enum class ExrCompression { kAuto, kNone, kZip, kPiz };

struct ModelFileOptions {
  TexelFormat format = TexelFormat::kFloat;
  ExrCompression compression = ExrCompression::kAuto;
};

/// Writes a model as one OpenEXR file: channels R (along), G (around), B (out), and the string attribute
/// "skeletex" with a versioned JSON object that holds everything else. Atomic; the same model gives the same bytes.
/// \throw IoError
void write_model(const std::filesystem::path& path, const SkeletexModel& model, const ModelFileOptions& options = {});

/// Writes a chain of levels of detail, the finest first, as one OpenEXR file with a part for each
/// (docs/file-formats.md). One level is written as write_model does.
/// \throw IoError
void write_model_levels(const std::filesystem::path& path, std::span<const SkeletexModel> levels,
                        const ModelFileOptions& options = {});

/// kVerify: header and texels must be those that were written (docs/file-formats.md). kIgnore: for files that another
/// program was meant to change.
enum class ChecksumRule { kVerify, kIgnore };

/// A model of an OpenEXR file, or of a compact one, which its first bytes tell apart.
/// \param level  part of the file: 0, the finest, is what files of one part have
/// \throw IoError: there is no such level; not an EXR, truncated, no skeletex attribute, a newer version, or contents
/// that do not fit together (every index, size and number is checked before use)
SkeletexModel read_model(const std::filesystem::path& path, int level = 0, ChecksumRule rule = ChecksumRule::kVerify);

/// The header's JSON of a model that is read and checked as by read_model.
nlohmann::json read_model_header(const std::filesystem::path& path, int level = 0);

/// Width and height of every level in a file.
/// \throw IoError
std::vector<std::array<int, 2>> read_model_levels(const std::filesystem::path& path);

}  // namespace skeletex
