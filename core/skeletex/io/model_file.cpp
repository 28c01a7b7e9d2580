// SPDX-License-Identifier: MIT
#include "skeletex/io/model_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfThreading.h>
#include <fmt/format.h>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "skeletex/io/atomic_file.h"
#include "skeletex/io/check_model.h"
#include "skeletex/io/compact/compact_model_file.h"
#include "skeletex/io/exr_survey.h"
#include "skeletex/io/json_file.h"
#include "skeletex/io/model_json.h"
#include "skeletex/model/error.h"
#include "skeletex/model/memory.h"

namespace skeletex {
namespace {

constexpr const char* kAttribute = "skeletex";
constexpr const char* kChannels[3] = {"R", "G", "B"};

/// XXH64 over the header's JSON, in which the digits of the checksum itself are zeros, and over the texels of all
/// channels as floats, in the order R, G, B, weights, layers.
class Checksum {
 public:
  static constexpr std::string_view kKey = "\"checksum\":\"", kZeros = "0000000000000000";

  explicit Checksum(std::string_view json_with_zeros) : state_(XXH64_createState(), XXH64_freeState) {
    XXH64_reset(state_.get(), 0);
    XXH64_update(state_.get(), json_with_zeros.data(), json_with_zeros.size());
  }
  void add(const std::vector<float>& texels) {
    XXH64_update(state_.get(), texels.data(), texels.size() * sizeof(float));
  }
  std::string digits() const { return fmt::format("{:016x}", XXH64_digest(state_.get())); }

  /// Where the digits are in a header's JSON; npos: it has none.
  static std::size_t find_digits(std::string_view json) {
    const std::size_t at = json.find(kKey);
    return at == std::string_view::npos || json.size() - at < kKey.size() + kZeros.size() ? std::string_view::npos
                                                                                          : at + kKey.size();
  }

 private:
  std::unique_ptr<XXH64_state_t, XXH_errorcode (*)(XXH64_state_t*)> state_;
};

/// OpenEXR's own streams lose write errors of their last bytes; this one keeps them (see OutputFile::close).
class ExrStream : public Imf::OStream {
 public:
  ExrStream(OutputFile& file, const std::string& name) : Imf::OStream(name.c_str()), file_(file) {}
  void write(const char bytes[], int count) override { file_.write({bytes, static_cast<std::size_t>(count)}); }
  std::uint64_t tellp() override { return file_.position(); }
  void seekp(std::uint64_t position) override { file_.seek(position); }

 private:
  OutputFile& file_;
};

/// Counts bytes.
class CountingStream : public Imf::OStream {
 public:
  CountingStream() : Imf::OStream("memory") {}
  void write(const char[], int count) override { size_ = std::max(size_, at_ += static_cast<std::uint64_t>(count)); }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t position) override { at_ = position; }
  std::uint64_t size() const { return size_; }

 private:
  std::uint64_t at_ = 0, size_ = 0;
};

/// Chunks are compressed independently and written in order, so the number of threads does not show in the file.
void use_threads() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (Imf::globalThreadCount() == 0)
      Imf::setGlobalThreadCount(static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1u, 8u)));
  });
}

const std::vector<float>& plane(const DisplacementTexture& texture, int i) {
  return i == 0 ? texture.along : i == 1 ? texture.around : texture.out;
}
std::vector<float>& plane(DisplacementTexture& texture, int i) {
  return i == 0 ? texture.along : i == 1 ? texture.around : texture.out;
}

/// \param is_good  what a value of the channel must be
/// \param what  why it is not
template <class Good>
void check_plane(const std::vector<float>& values, const std::string& channel, const DisplacementTexture& texture,
                 const Good& is_good, const char* what, const std::string& where) {
  const std::size_t count = static_cast<std::size_t>(texture.width) * static_cast<std::size_t>(texture.height);
  if (values.size() != count) throw IoError(fmt::format("{}: channel {} must have {} texels", where, channel, count));
  const auto bad = std::find_if_not(values.begin(), values.end(), is_good);
  if (bad == values.end()) return;
  const auto at = static_cast<int>(bad - values.begin());
  throw IoError(fmt::format("{}: channel {} at column {}, row {} is {}", where, channel, at % texture.width,
                            at / texture.width, what));
}

void check_texels(const SkeletexModel& model, const std::string& where) {
  for (int i = 0; i < 3; ++i)
    check_plane(
        plane(model.texture, i), kChannels[i], model.texture,
        [&](float x) { return std::abs(x) <= kMostDiagonals * model.diagonal; },
        "not a finite number, or beyond 100 diagonals", where);
  const std::vector<std::vector<std::string>> names = layer_channels(model.layers);
  for (std::size_t i = 0; i < names.size(); ++i)
    for (std::size_t k = 0; k < names[i].size(); ++k)
      check_plane(
          model.layers[i].planes[k], names[i][k], model.texture,
          [is_normal = model.layers[i].kind == LayerKind::kNormal](float x) {
            return is_normal ? std::abs(x) <= 1 : std::isfinite(x);
          },
          "not a finite number, or beyond -1 to 1 in a normal", where);
  if (model.bone_weights.empty()) return;
  if (model.bone_weights.size() != model.skeleton.bones.size())
    throw IoError(fmt::format("{}: weights of {} bones are expected, not of {}", where, model.skeleton.bones.size(),
                              model.bone_weights.size()));
  const std::vector<std::string> channels = weight_channels(model.skeleton);
  for (std::size_t bone = 0; bone < channels.size(); ++bone)
    check_plane(
        model.bone_weights[bone], channels[bone], model.texture, [](float x) { return x >= 0 && std::isfinite(x); },
        "no weight: at least 0, and finite", where);
}

nlohmann::json header_json(const ExrSurvey& survey, const std::string& where) {
  const auto found = survey.attributes.find(kAttribute);
  if (found == survey.attributes.end() || found->second.type != "string")
    throw IoError(fmt::format(
        "{}: an OpenEXR image, but not a model: its header has no text \"{}\" (some programs drop it when they save)",
        where, kAttribute));
  nlohmann::json json = parse_json(found->second.value, fmt::format("{}: header \"{}\"", where, kAttribute));
  if (!json.is_object() || json.value("format", nlohmann::json()) != kAttribute)
    throw IoError(fmt::format("{}: an OpenEXR image, but its header is not that of a model", where));
  return json;
}

/// Runs OpenEXR; whatever it throws becomes an IoError.
template <typename Run>
void with_openexr(const std::string& where, const char* what, const Run& run) {
  try {
    run();
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    std::string text = error.what();
    std::erase_if(text, [](unsigned char c) { return c < 32 || c > 126; });
    throw IoError(fmt::format("{}: {}: {}", where, what, text.substr(0, 300)));
  }
}

/// A model checked and turned into what OpenEXR writes; the model must outlive it.
struct ExrPart {
  Imf::Header header;
  Imf::FrameBuffer frame;
  std::vector<std::vector<half>> halves;  ///< what the frame reads, where it is not the model's own planes
};

/// Whether ZIP takes off an eighth or more, by three pieces of its blocks of lines.
bool pays_zip(const ExrPart& part, int width, int height) {
  constexpr int kLines = 16, kBlocks = 3, kColumns = 128;
  if (height < 2 * kLines * kBlocks) return true;
  const int columns = std::min(width, kColumns);
  Imf::Header header(columns, kLines * kBlocks);
  header.compression() = Imf::ZIP_COMPRESSION;
  header.channels() = part.header.channels();
  Imf::FrameBuffer frame;
  std::vector<std::vector<char>> planes;
  for (auto slice = part.frame.begin(); slice != part.frame.end(); ++slice) {
    const std::size_t texel = slice.slice().xStride, line = slice.slice().yStride;
    std::vector<char>& plane = planes.emplace_back();
    for (int i = 0; i < kBlocks * kLines; ++i) {
      const int block = i / kLines;
      const char* from =
          slice.slice().base +
          line * static_cast<std::size_t>(height * (block + 1) / (kBlocks + 1) - kLines / 2 + i % kLines) +
          texel * static_cast<std::size_t>((width - columns) * block / (kBlocks - 1));
      plane.insert(plane.end(), from, from + texel * columns);
    }
    frame.insert(slice.name(), Imf::Slice(slice.slice().type, plane.data(), texel, texel * columns));
  }
  CountingStream counted;
  {
    Imf::OutputFile exr(counted, header);
    exr.setFrameBuffer(frame);
    exr.writePixels(kLines * kBlocks);
  }
  std::size_t plain = 0;
  for (const std::vector<char>& plane : planes) plain += plane.size();
  return 8 * counted.size() < 7 * plain;
}

ExrPart make_part(const SkeletexModel& model, const ModelFileOptions& options, const std::string& where) {
  check_model(model, where);
  check_texels(model, where);
  const int width = model.texture.width, height = model.texture.height;
  std::string json;
  try {
    nlohmann::json root = model_to_json(model, where);
    root["checksum"] = Checksum::kZeros;
    json = root.dump();
  } catch (const nlohmann::json::exception& error) {
    throw IoError(fmt::format("{}: a name in the skeleton is not UTF-8 text: {}", where, error.what()));
  }
  ExrPart part{Imf::Header(width, height), {}, {}};
  Checksum checksum(json);
  const auto add_channel = [&](const std::string& name, const std::vector<float>& texels, bool is_half) {
    const void* data = texels.data();
    if (is_half) {
      const auto largest =
          std::max_element(texels.begin(), texels.end(), [](float a, float b) { return std::abs(a) < std::abs(b); });
      if (std::abs(*largest) > HALF_MAX)
        throw IoError(fmt::format(
            "{}: channel {} has {}, beyond half precision's range of +-65504; store float, or scale the mesh", where,
            name, *largest));
      const std::vector<half>& halves = part.halves.emplace_back(texels.begin(), texels.end());
      data = halves.data();
      checksum.add({halves.begin(), halves.end()});
    } else {
      checksum.add(texels);
    }
    const Imf::PixelType type = is_half ? Imf::HALF : Imf::FLOAT;
    const std::size_t bytes = is_half ? sizeof(half) : sizeof(float);
    part.header.channels().insert(name, Imf::Channel(type));
    part.frame.insert(name, Imf::Slice(type, static_cast<char*>(const_cast<void*>(data)), bytes,
                                       bytes * static_cast<std::size_t>(width)));
  };
  const bool has_halves = options.format == TexelFormat::kHalf;
  for (int i = 0; i < 3; ++i) add_channel(kChannels[i], plane(model.texture, i), has_halves);
  if (!model.bone_weights.empty()) {
    const std::vector<std::string> channels = weight_channels(model.skeleton);
    for (std::size_t bone = 0; bone < channels.size(); ++bone)
      add_channel(channels[bone], model.bone_weights[bone], has_halves);
  }
  // Half floats hold directions to 0.03 degrees, and more colours than the 8 bits of a picture.
  const std::vector<std::vector<std::string>> names = layer_channels(model.layers);
  for (std::size_t i = 0; i < names.size(); ++i)
    for (std::size_t k = 0; k < names[i].size(); ++k)
      add_channel(names[i][k], model.layers[i].planes[k], model.layers[i].kind != LayerKind::kNumber);
  json.replace(Checksum::find_digits(json), Checksum::kZeros.size(), checksum.digits());
  part.header.insert(kAttribute, Imf::StringAttribute(json));
  const bool has_zip = options.compression == ExrCompression::kZip ||
                       (options.compression == ExrCompression::kAuto && pays_zip(part, width, height));
  part.header.compression() = has_zip                                       ? Imf::ZIP_COMPRESSION
                              : options.compression == ExrCompression::kPiz ? Imf::PIZ_COMPRESSION
                                                                            : Imf::NO_COMPRESSION;
  return part;
}

}  // namespace

void write_model(const std::filesystem::path& path, const SkeletexModel& model, const ModelFileOptions& options) {
  write_model_levels(path, std::span(&model, 1), options);
}

void write_model_levels(const std::filesystem::path& path, std::span<const SkeletexModel> levels,
                        const ModelFileOptions& options) {
  const std::string where = path.string();
  if (levels.empty()) throw IoError(where + ": a model has at least one level");
  std::vector<ExrPart> parts;
  parts.reserve(levels.size());  // the frame of a part that is copied shows into the old one
  for (const SkeletexModel& level : levels) parts.push_back(make_part(level, options, where));
  // To be handed a plain line takes a thread longer than to write it.
  if (std::any_of(parts.begin(), parts.end(),
                  [](const ExrPart& part) { return part.header.compression() != Imf::NO_COMPRESSION; }))
    use_threads();
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    OutputFile file(temporary, path);
    with_openexr(where, "cannot write", [&] {
      ExrStream stream(file, where);
      if (parts.size() == 1) {
        Imf::OutputFile exr(stream, parts[0].header);
        exr.setFrameBuffer(parts[0].frame);
        exr.writePixels(levels[0].texture.height);
        return;
      }
      std::vector<Imf::Header> headers;
      for (std::size_t level = 0; level < parts.size(); ++level) {
        headers.push_back(parts[level].header);
        headers.back().setName(fmt::format("level {}", level));
        headers.back().setType(Imf::SCANLINEIMAGE);
        // Viewers show all parts of a file within one window.
        headers.back().displayWindow() = headers.front().displayWindow();
      }
      Imf::MultiPartOutputFile exr(stream, headers.data(), static_cast<int>(headers.size()));
      for (std::size_t level = 0; level < parts.size(); ++level) {
        Imf::OutputPart part(exr, static_cast<int>(level));
        part.setFrameBuffer(parts[level].frame);
        part.writePixels(levels[level].texture.height);
      }
    });
    file.close();
  });
}

namespace {

const ExrSurvey& part_of(const std::vector<ExrSurvey>& parts, int level, const std::string& where) {
  if (level < 0 || level >= static_cast<int>(parts.size()))
    throw IoError(fmt::format("{}: there is no level {}; the file has {}", where, level,
                              parts.size() == 1 ? "level 0 alone" : fmt::format("levels 0 to {}", parts.size() - 1)));
  return parts[level];
}

/// A level of a file as it is, with the JSON of its header.
struct ReadModel {
  nlohmann::json header;
  SkeletexModel model;
};

/// A channel's name in the file, and its texels.
using NamedPlane = std::pair<std::string, std::vector<float>*>;

/// That header and texels are those that were written. Files of version 1 have no checksum.
/// \param planes  all channels, in the order of the checksum
void check_sum(std::string json, const nlohmann::json& header, const std::vector<NamedPlane>& planes,
               const std::string& where) {
  const std::size_t at = Checksum::find_digits(json);
  if (at == std::string::npos) {
    if (header.value("version", 0) > 1) throw IoError(where + ": the header is damaged (no checksum)");
    return;
  }
  const std::string written = json.substr(at, Checksum::kZeros.size());
  Checksum checksum(json.replace(at, Checksum::kZeros.size(), Checksum::kZeros));
  for (const auto& [name, values] : planes) checksum.add(*values);
  if (checksum.digits() != written)
    throw IoError(fmt::format(
        "{}: the file is damaged, or was changed by another program: its checksum is {} instead of {}. Copy it again; "
        "if you have edited it, take it over with `skeletex weights {} --edited -o FILE`",
        where, checksum.digits(), written, where));
}

/// Reads channels of a level, each into its plane.
void read_planes(const std::filesystem::path& path, int level, int width, int height,
                 const std::vector<NamedPlane>& planes) {
  const std::string where = path.string();
  const std::size_t size = static_cast<std::size_t>(width) * height;
  require_memory(static_cast<double>(planes.size() * size * sizeof(float)),
                 fmt::format("reading {} ({} x {} texels)", where, width, height));
  use_threads();
  with_openexr(where, "cannot read, the file is damaged", [&] {
    Imf::MultiPartInputFile file(path.c_str());
    Imf::InputPart exr(file, level);
    Imf::FrameBuffer frame;
    for (const auto& [name, values] : planes) {
      const Imf::Channel* channel = exr.header().channels().findChannel(name);
      if (channel == nullptr || channel->xSampling != 1 || channel->ySampling != 1 || channel->type == Imf::UINT)
        throw IoError(
            fmt::format("{}: a model has the channels R, G, B and those of its weights and layers in full resolution, "
                        "float or half; {} is not like that",
                        where, name));
      values->resize(size);
      frame.insert(
          name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values->data()), sizeof(float), sizeof(float) * width));
    }
    const Imath::Box2i window = exr.header().dataWindow();
    if (window.min != Imath::V2i(0, 0) || window.max != Imath::V2i(width - 1, height - 1))
      throw IoError(where + ": the file changed while it was read");
    exr.setFrameBuffer(frame);
    exr.readPixels(0, height - 1);
  });
}

ReadModel read_level(const std::filesystem::path& path, int level, ChecksumRule rule) {
  const std::string where = path.string();
  ReadModel result;
  SkeletexModel& model = result.model;
  const nlohmann::json& header = result.header;
  std::string json;
  std::vector<std::string> weight_names;
  std::vector<std::vector<std::string>> layer_names;
  {
    const std::vector<ExrSurvey> parts = survey_exr(path, kMaxTextureSize);
    const ExrSurvey& survey = part_of(parts, level, where);
    result.header = header_json(survey, where);
    json = survey.attributes.at(kAttribute).value;
    model = model_from_json(header, where);
    weight_names = weight_channels(header, model.skeleton.bones.size(), where);
    model.bone_weights.resize(weight_names.size());
    NamedLayers named = layers_from_json(header, where);
    model.layers = std::move(named.layers);
    layer_names = std::move(named.channels);
    if (model.texture.width != survey.width || model.texture.height != survey.height)
      throw IoError(fmt::format(
          "{}: the image has {} x {} texels, but the model in its header {} x {}; it was resized by another program",
          where, survey.width, survey.height, model.texture.width, model.texture.height));
  }
  std::vector<NamedPlane> planes;
  for (int i = 0; i < 3; ++i) planes.emplace_back(kChannels[i], &plane(model.texture, i));
  for (std::size_t bone = 0; bone < weight_names.size(); ++bone)
    planes.emplace_back(weight_names[bone], &model.bone_weights[bone]);
  for (std::size_t i = 0; i < layer_names.size(); ++i)
    for (std::size_t k = 0; k < layer_names[i].size(); ++k)
      planes.emplace_back(layer_names[i][k], &model.layers[i].planes[k]);
  read_planes(path, level, model.texture.width, model.texture.height, planes);
  check_texels(model, where);
  if (rule == ChecksumRule::kVerify) check_sum(std::move(json), header, planes, where);
  return result;
}

}  // namespace

namespace {

/// The model of a compact file, or nothing where the file is another one.
std::optional<SkeletexModel> read_compact_level(const std::filesystem::path& path, int level) {
  if (!is_compact_file(path)) return {};
  const std::string where = path.string();
  if (level != 0)
    throw IoError(fmt::format("{}: there is no level {}; a compact file has level 0 alone", where, level));
  return read_compact_model(path);
}

}  // namespace

SkeletexModel read_model(const std::filesystem::path& path, int level, ChecksumRule rule) {
  if (std::optional<SkeletexModel> compact = read_compact_level(path, level)) return std::move(*compact);
  return read_level(path, level, rule).model;
}

nlohmann::json read_model_header(const std::filesystem::path& path, int level) {
  if (const std::optional<SkeletexModel> compact = read_compact_level(path, level))
    return model_to_json(*compact, path.string());
  return read_level(path, level, ChecksumRule::kVerify).header;
}

std::vector<std::array<int, 2>> read_model_levels(const std::filesystem::path& path) {
  if (const std::optional<SkeletexModel> compact = read_compact_level(path, 0))
    return {{compact->texture.width, compact->texture.height}};
  std::vector<std::array<int, 2>> sizes;
  for (const ExrSurvey& part : survey_exr(path, kMaxTextureSize)) sizes.push_back({part.width, part.height});
  return sizes;
}

}  // namespace skeletex
