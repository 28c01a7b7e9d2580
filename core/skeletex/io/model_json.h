// SPDX-License-Identifier: MIT
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "skeletex/model/texture.h"

namespace skeletex {

/// Version of the model file's JSON that this library writes, and the newest it reads.
inline constexpr int kModelFileVersion = 2;

/// Everything of a model but its texels (docs/file-formats.md). Doubles come back bit by bit.
/// \throw IoError when names or settings are no valid text
nlohmann::json model_to_json(const SkeletexModel& model, const std::string& where);
/// A model with the texture's size, but without texels; checked by check_model.
/// \throw IoError
SkeletexModel model_from_json(const nlohmann::json& json, const std::string& where);

/// The channels that hold the weights of bones, one per bone: "weights." and the bone's name, in which all but letters,
/// digits, - and _ is _.
std::vector<std::string> weight_channels(const Skeleton& skeleton);
/// The channels that a header names for its weights, one per bone; empty: it names none.
/// \throw IoError
std::vector<std::string> weight_channels(const nlohmann::json& header, std::size_t bones, const std::string& where);
/// The channels that hold the planes of a model's layers, in their order: the layer's name, in which all but letters,
/// digits, - and _ is _, a dot, and R, G, B, A, or Y for a plane of numbers.
std::vector<std::vector<std::string>> layer_channels(const std::vector<Layer>& layers);
/// The layers that a header names, with empty planes, and the channels of these.
/// \throw IoError
struct NamedLayers {
  std::vector<Layer> layers;
  std::vector<std::vector<std::string>> channels;
};
NamedLayers layers_from_json(const nlohmann::json& header, const std::string& where);

}  // namespace skeletex
