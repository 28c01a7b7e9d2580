// SPDX-License-Identifier: MIT
#include "skeletex/edit/live.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "skeletex/edit/morph/blend.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// Moves a model's texels to the device.
DevicePlanes take_texels(ClContext& context, SkeletexModel& model) {
  DevicePlanes planes = upload_texels(context, model.texture);
  model.texture = {model.texture.width, model.texture.height, {}, {}, {}};
  return planes;
}

/// What the two models differ in that a blend of texels cannot join; nullptr: nothing.
const char* difference(const SkeletexModel& a, const SkeletexModel& b) {
  const auto same_nodes = [](const Node& p, const Node& q) { return p.position == q.position; };
  const auto same_bones = [](const Bone& p, const Bone& q) {
    return p.head == q.head && p.tail == q.tail && p.s == q.s;
  };
  const auto same_rectangles = [](const Patch& p, const Patch& q) {
    return p.rectangle.x == q.rectangle.x && p.rectangle.y == q.rectangle.y && p.rectangle.width == q.rectangle.width &&
           p.rectangle.height == q.rectangle.height;
  };
  const auto same_arcs = [](const SeamArc& p, const SeamArc& q) {
    return p.bones == q.bones && p.corners == q.corners && p.samples.size() == q.samples.size();
  };
  const auto same_corners = [](const SeamCorner& p, const SeamCorner& q) {
    return p.node == q.node && p.bones == q.bones;
  };
  if (a.skeleton.frame != b.skeleton.frame || !std::ranges::equal(a.skeleton.nodes, b.skeleton.nodes, same_nodes) ||
      !std::ranges::equal(a.skeleton.bones, b.skeleton.bones, same_bones))
    return "skeletons";
  if (a.texture.width != b.texture.width || a.texture.height != b.texture.height ||
      !std::ranges::equal(a.patches, b.patches, same_rectangles))
    return "layouts";
  if (!std::ranges::equal(a.arcs, b.arcs, same_arcs) || !std::ranges::equal(a.corners, b.corners, same_corners))
    return "seams";
  return nullptr;
}

double between(double a, double b, double share) {
  return a == b || share == 0 ? a : share == 1 ? b : (1 - share) * a + share * b;
}

SeamSample between(const SeamSample& a, const SeamSample& b, double share) {
  const double there = b.turn - std::round(b.turn - a.turn);  // the short way round
  const double turn = between(a.turn, there, share);
  return {turn - std::floor(turn), between(a.distance, b.distance, share)};
}

}  // namespace

LiveMorph::LiveMorph(ClContext& context, const Morph& morph, std::vector<std::vector<double>> path, int steps)
    : context_(&context), morph_(&morph), path_(std::move(path)), steps_(steps) {
  if (!morph.layout()) throw InputError("a live morph keeps one layout on its way; give the number of the model whose");
  if (path_.size() < 2 || steps < 1)
    throw InputError("a live morph goes from one set of weights to another in one step or more");
  for (const std::vector<double>& weights : path_)
    if (weights.size() != morph.models().size())
      throw InputError(
          fmt::format("{} weights for {} models; give one per model", weights.size(), morph.models().size()));
  for (std::size_t key = 0; key <= steps_ * (path_.size() - 1); ++key)
    morph.queue(weights(static_cast<double>(key) / steps_), keys_.emplace_back());
}

std::vector<double> LiveMorph::weights(double t) const {
  t = std::clamp(t, 0.0, static_cast<double>(path_.size() - 1));
  const std::size_t leg = std::min(static_cast<std::size_t>(t), path_.size() - 2);
  const double share = t - static_cast<double>(leg);
  std::vector<double> mean;
  for (std::size_t m = 0; m < path_[leg].size(); ++m) mean.push_back(between(path_[leg][m], path_[leg + 1][m], share));
  return mean;
}

SkeletexModel LiveMorph::queue(double t, DevicePlanes& texels) const {
  const double place = std::clamp(t * steps_, 0.0, static_cast<double>(keys_.size() - 1));
  const std::size_t key = std::min(static_cast<std::size_t>(place), keys_.size() - 2);
  // Queued first, so that the device works while the host finds the seams.
  mix_texels(*context_, keys_[key], keys_[key + 1], place - static_cast<double>(key),
             morph_->models()[*morph_->layout()].texture.width, texels);
  return morph_->without_texels(weights(t));
}

LiveBlend::LiveBlend(ClContext& context, SkeletexModel first, const SkeletexModel& second)
    : context_(&context), first_(std::move(first)), second_(second) {
  if (const char* what = difference(first_, second_))
    throw InputError(fmt::format("the two models have different {}; a live blend needs the same", what));
  first_texels_ = take_texels(context, first_);
  second_texels_ = take_texels(context, second_);
}

SkeletexModel LiveBlend::queue(double share, DevicePlanes& texels) const {
  share = std::clamp(share, 0.0, 1.0);
  SkeletexModel model = share == 1 ? second_ : first_;
  for (std::size_t b = 0; b < model.patches.size(); ++b)
    for (std::size_t r = 0; r < model.patches[b].row_u.size(); ++r)
      model.patches[b].row_u[r] = between(first_.patches[b].row_u[r], second_.patches[b].row_u[r], share);
  for (std::size_t a = 0; a < model.arcs.size(); ++a)
    for (std::size_t i = 0; i < model.arcs[a].samples.size(); ++i)
      model.arcs[a].samples[i] = between(first_.arcs[a].samples[i], second_.arcs[a].samples[i], share);
  for (std::size_t c = 0; c < model.corners.size(); ++c)
    model.corners[c].sample = between(first_.corners[c].sample, second_.corners[c].sample, share);
  mix_texels(*context_, first_texels_, second_texels_, share, model.texture.width, texels);
  return model;
}

SkeletexModel LiveBlend::at(double share) const {
  DevicePlanes texels;
  SkeletexModel model = queue(share, texels);
  download_texels(*context_, texels, model.texture);
  return model;
}

}  // namespace skeletex
