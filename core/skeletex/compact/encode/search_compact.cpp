// SPDX-License-Identifier: MIT
#include "skeletex/compact/encode/search_compact.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "skeletex/analysis/metro.h"
#include "skeletex/compact/compact_file.h"
#include "skeletex/compact/decode_model.h"
#include "skeletex/compact/encode/encode_layers.h"
#include "skeletex/compact/encode/reduce_intersections.h"
#include "skeletex/math/portable.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

/// Trials are measured with so many points per surface, and the result with more.
constexpr long kTrialSamples = 60'000, kSamples = 400'000;
constexpr double kTrialShare = 0.997;  // of a wanted error, for trials
constexpr int kSize = 512, kLargestSize = 2048;
/// A largest error above both, a share of the diagonal and a multiple of the wanted mean, tells of a missing part, such
/// as a horn between coarse samples.
constexpr double kFurthest = 0.02, kFurthestOfMean = 20;
constexpr double kLargestStep = 1e-2, kSmallestStep = 1e-7;
/// The least that the logarithm of the error grows with that of the step while residuals matter, and how much larger
/// the step of the same error is with residuals in one more level.
constexpr double kLeastSlope = 0.15, kStepRatio = 1.7;

class Search {
 public:
  Search(ClContext& context, const SkeletexModel& model, const TriangleMesh* reference, const CompactGoal& goal)
      : context_(context), model_(in_unit_frame(model)), goal_(goal), size_(goal.size.value_or(kSize)) {
    const PreparedModel prepared(model_);
    source_ = source_surface(context, prepared);
    reference_ = reference != nullptr ? *reference : reconstruct_bind_mesh(context, prepared).mesh;
    metro_.emplace(context, reference_, kTrialSamples);
  }

  CompactResult run() {
    if (goal_.quality) return measured(completed(by_quality()));
    if (!goal_.max_bytes) return within_error(goal_.max_error.value_or(1e-4));
    // The shape gets what the layers leave of the bytes; how much they take depends a little on the shape.
    std::size_t for_shape = *goal_.max_bytes;
    for (int i = 0; i < 10; ++i) {
      Trial result = completed(by_bytes(for_shape));
      const std::size_t bytes = compact_bytes(result.model).size();
      if (bytes <= *goal_.max_bytes) return measured(result);
      const std::size_t fewer = bytes - *goal_.max_bytes + for_shape / 64;
      if (fewer >= for_shape) break;
      for_shape -= fewer;
    }
    throw InputError(
        fmt::format("the model and its layers do not fit into {} bytes; code the layers in fewer steps "
                    "(--layer-steps), or leave them out",
                    *goal_.max_bytes));
  }

 private:
  struct Trial {
    CompactOptions options;
    CompactModel model;
    SymmetricDistance distance;
    std::size_t bytes = 0;  ///< see count_bytes
  };
  static std::size_t count_bytes(Trial& trial) {
    if (trial.bytes == 0) trial.bytes = compact_bytes(trial.model).size();
    return trial.bytes;
  }

  CompactOptions options_of(double step, int bare_levels) const {
    CompactOptions options;
    options.step = static_cast<float>(step);
    options.size = size_;
    options.bare_levels = bare_levels;
    return options;
  }
  TriangleMesh mesh_of(const CompactModel& compact, int octaves) {
    return reconstruct_bind_mesh(context_, decode_model(compact, octaves)).mesh;
  }
  /// What is predicted alone is measured one octave beyond what has residuals; it hardly changes beyond.
  /// \return the mean
  double measure(Trial& trial) {
    ++trials_;
    const TriangleMesh mesh = mesh_of(trial.model, -std::max(0, (trial.model.bare_levels - 2) / 2));
    trial.distance = metro_->measure(mesh);
    return trial.distance.mean;
  }
  /// \param weights  of a trial with as many levels, see CompactOptions; null: this trial's own
  Trial trial(double step, int bare_levels, const Trial* weights = nullptr) {
    Trial result{options_of(step, bare_levels), {}, {}, 0};
    if (weights != nullptr) result.options.weights = weights->model.weights;
    result.model = encode_compact(model_, source_, result.options);
    return result;
  }
  /// A trial with fewer triangles that intersect, and the layers of the model.
  Trial completed(Trial trial) {
    reduce_intersections(context_, model_, source_, trial.options, trial.model);
    trial.bytes = 0;
    if (goal_.layer_steps == 0 || !has_coded_layers(model_)) return trial;
    trial.options.layer_steps = goal_.layer_steps;
    trial.model = encode_compact(model_, source_, trial.options);
    return trial;
  }
  CompactResult measured(const Trial& trial) {
    CompactResult result{compact_bytes(trial.model), 0, trial.options, 0, 0, trials_};
    if (!trial.model.layers.empty()) {
      CompactModel shape = trial.model;
      shape.layers.clear();
      for (CompactPatch& patch : shape.patches) patch.planes.clear();
      const std::size_t without = compact_bytes(shape).size();
      result.layer_bytes = result.bytes.size() - std::min(without, result.bytes.size());
    }
    const SymmetricDistance distance = SymmetricMetro(context_, reference_, kSamples).measure(mesh_of(trial.model, 0));
    result.mean = distance.mean, result.max = distance.max;
    return result;
  }

  /// How the logarithm of a value grows with that of the step: what was measured, within what is usual.
  static double slope_of(bool rises, double step_change, double value_change, bool is_measured) {
    if (!is_measured || std::abs(step_change) <= 1e-3) return rises ? 0.45 : -0.9;
    const double measured = value_change / step_change;
    return rises ? std::clamp(measured, kLeastSlope, 1.5) : std::clamp(measured, -2.0, -0.2);
  }
  /// Whether a search for an error leads nowhere: the trial that keeps to it will have more bytes than there may be, or
  /// the error hardly falls though the step falls much, as it is that of what has no residuals. Near the wanted error,
  /// the logarithm of the bytes falls by half to one and a tenth of what that of the error rises.
  /// \param most_bytes  0: no limit
  static bool is_in_vain(Trial& trial, double reached, double step_change, double value_change,
                         std::size_t most_bytes) {
    if (most_bytes > 0 &&
        static_cast<double>(count_bytes(trial)) * portable::exp((reached > 0 ? 0.5 : 1.1) * reached) >=
            static_cast<double>(most_bytes))
      return true;
    return reached > 0 && step_change < -0.5 && value_change > kLeastSlope * step_change;
  }
  /// The step to begin with: that of the best trial so far, with another number of levels.
  static double first_step(const std::optional<Trial>& best, int bare_levels, double wanted) {
    return best ? best->options.step * portable::pow(kStepRatio, best->options.bare_levels - bare_levels)
                : 2.4 * wanted;
  }

  /// Whether a good trial comes nearer to what is wanted than the best one so far.
  static bool is_nearer(const Trial& trial, const std::optional<Trial>& best, bool rises) {
    if (!best) return true;
    return rises ? trial.options.step > best->options.step : trial.options.step < best->options.step;
  }

  /// The trial that keeps a value just within what is wanted; nothing where none does.
  /// \param rises  whether the value grows with the step, as errors do, or falls, as sizes do
  /// \param value  of a trial; positive
  /// \param most_bytes  where the value is an error: the search ends when it will take more bytes; 0: no limit
  std::optional<Trial> largest_step(int bare_levels, double first, double wanted, bool rises,
                                    const std::function<double(Trial&)>& value, std::size_t most_bytes = 0) {
    std::optional<Trial> best, before;
    double log_low = portable::log(kSmallestStep), log_high = portable::log(kLargestStep), at = portable::log(first);
    double last_at = 0, last_value = 0;
    for (int i = 0; i < 7; ++i) {
      Trial now = trial(portable::exp(at), bare_levels, before ? &*before : nullptr);
      if (!before) before = now;
      const double reached = portable::log(value(now) / wanted), signed_off = rises ? reached : -reached;
      // Above: the step must become smaller where the value rises with it.
      (signed_off > 0 ? log_high : log_low) = at;
      const bool is_good = reached <= 0;
      if (rises && is_in_vain(now, reached, i > 0 ? at - last_at : 0, reached - last_value, most_bytes)) break;
      if (is_good && is_nearer(now, best, rises)) best = std::move(now);
      if (is_good && reached > -0.02) break;
      const double slope = slope_of(rises, at - last_at, reached - last_value, i > 0);
      last_at = at;
      last_value = reached;
      at = std::clamp(at - (reached + 0.01) / slope, at - 2.5, at + 2.5);
      if (at <= log_low || at >= log_high) at = std::clamp((log_low + log_high) / 2, last_at - 2.5, last_at + 2.5);
      if (log_high - log_low < 0.01) break;
    }
    return best;
  }

  /// Trials are measured at fewer points than the result.
  CompactResult within_error(double wanted) {
    Trial trial = completed(by_error(kTrialShare * wanted));
    for (int i = 0; i < 8; ++i) {
      CompactResult result = measured(trial);
      if (result.mean <= wanted) return result;
      trial = completed(this->trial(0.98 * trial.options.step, trial.options.bare_levels, &trial));
    }
    return measured(trial);
  }

  Trial by_error(double wanted) {
    for (;; size_ *= 2) {
      if (const std::optional<Trial> found = fewest_bytes(wanted)) return *found;
      if (goal_.size || 2 * size_ > kLargestSize) break;
    }
    throw InputError(fmt::format("an error of {:g} diagonals is out of reach at {} x {} texels; ask for more{}", wanted,
                                 size_, size_, goal_.size ? ", or give a larger --size" : ""));
  }

  static bool lacks_part(const Trial& trial, double wanted) {
    return trial.distance.max > std::max(kFurthest, kFurthestOfMean * wanted);
  }
  /// Replaces the best trial so far by one with another number of levels that keeps to an error, if it is better: with
  /// all parts of the body, or fewer bytes.
  /// \return whether it was
  bool find_better(int bare_levels, double wanted, std::optional<Trial>& best) {
    const bool wants_part = best && lacks_part(*best, wanted);
    std::optional<Trial> found = largest_step(
        bare_levels, first_step(best, bare_levels, wanted), wanted, true, [&](Trial& t) { return measure(t); },
        best && !wants_part ? best->bytes : 0);
    if (!found) return false;
    count_bytes(*found);
    const bool lacks = lacks_part(*found, wanted);
    if (best && (lacks == wants_part ? found->bytes >= best->bytes : lacks)) return false;
    best = std::move(found);
    return true;
  }

  /// The trial with the fewest bytes that keeps to an error; nothing where none is found.
  std::optional<Trial> fewest_bytes(double wanted) {
    std::optional<Trial> best;
    const auto try_levels = [&](int bare) { return bare >= 0 && find_better(bare, wanted, best); };
    // Downhill from where the spacing of the residuals suits the error as on the standard models.
    const int first =
        std::clamp(static_cast<int>(std::lround(2 * std::log2(size_ / 256.0) + std::log2(wanted / 1e-4))), 0, 12);
    int bare = first;
    while (bare >= 0 && !try_levels(bare)) bare -= 2;
    // All levels with residuals take more bytes than a larger size does.
    if (!best && goal_.size) try_levels(0);
    const int start = bare;
    if (best && start == first && !lacks_part(*best, wanted))
      while (try_levels(++bare)) {
      }
    if (best && bare <= start + 1) {
      bare = start;
      while (--bare >= 0 && (try_levels(bare) || lacks_part(*best, wanted))) {
      }
    }
    return best;
  }

  Trial by_bytes(std::size_t most) {
    const auto wanted = static_cast<double>(most);
    std::optional<Trial> best;
    for (int bare = std::max(0, static_cast<int>(2 * std::log2(size_ / 256.0))); bare <= 12; ++bare) {
      std::optional<Trial> found =
          largest_step(bare, 3e-4, wanted, false, [&](Trial& t) { return static_cast<double>(count_bytes(t)); });
      if (!found) continue;
      const double mean = measure(*found);
      if (best && mean >= best->distance.mean) break;
      best = std::move(found);
    }
    if (!best) throw InputError(fmt::format("the model does not fit into {} bytes", most));
    return *best;
  }

  /// Finest levels are dropped while nearly all of their residuals are 0.
  Trial by_quality() {
    constexpr double kFewest = 0.04;
    const double step = portable::pow(10.0, -2 - *goal_.quality / 25);
    Trial whole = trial(step, 0);
    int bare = 0;
    for (bool is_sparse = true; is_sparse && bare < 16; bare += is_sparse ? 1 : 0) {
      std::size_t count = 0, others = 0;
      for (const CompactPatch& patch : whole.model.patches) {
        if (patch.step_count <= bare) continue;
        const std::vector<int>& residuals = patch.steps[patch.step_count - 1 - bare].normal;
        count += residuals.size();
        others += residuals.size() - std::count(residuals.begin(), residuals.end(), 0);
      }
      is_sparse = count > 0 && static_cast<double>(others) < kFewest * static_cast<double>(count);
    }
    return bare == 0 ? whole : trial(step, bare);
  }

  ClContext& context_;
  SkeletexModel model_;
  CompactGoal goal_;
  int size_;  ///< that trials have
  SourceSurface source_;
  TriangleMesh reference_;
  std::optional<SymmetricMetro> metro_;  // of the reference, for trials
  int trials_ = 0;
};

}  // namespace

CompactResult search_compact(ClContext& context, const SkeletexModel& model, const TriangleMesh* reference,
                             const CompactGoal& goal) {
  return Search(context, model, reference, goal).run();
}

}  // namespace skeletex
