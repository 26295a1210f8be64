// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/trainer.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace cairn {
namespace {

constexpr float kExposureRate = 5e-3f;
constexpr double kFinalPositionRate = 0.01;  // relative to the first
constexpr double kFirstColorRate = 4;        // relative to the last
constexpr double kSmallImages = 0.3;         // share of the training with the images of a smaller level
constexpr double kDensifyEnd = 0.6;          // share of the training
constexpr float kMinMotion = 2e-4f;          // gradient per image size at which a splat is split
constexpr float kMaxGrowth = 0.05f;          // share of splats split at once
constexpr double kMaxEntryGrowth = 1.25;     // of an image's entries until the next densification
constexpr float kMinOpacity = 0.01f;         // less is removed
constexpr float kMaxSplatSize = 0.5f;        // meters, standard deviation
constexpr float kSplitShift = 0.5f,
                kSplitScale = 0.6f;  // in standard deviations along the longest axis

float opacity_of(float logit) { return 1 / (1 + std::exp(-logit)); }

Eigen::Matrix3f rotation_of(const Eigen::Vector4f& q) {
  return Eigen::Quaternionf(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
}

/// Splats picked from a model, with their indices there.
class Picked {
 public:
  explicit Picked(const Splats& from) : from_(from) { splats.degree = from.degree; }
  void take(std::size_t i) {
    const std::size_t harmonics = harmonics_per_splat(from_.degree);
    splats.positions.push_back(from_.positions[i]);
    splats.log_scales.push_back(from_.log_scales[i]);
    splats.rotations.push_back(from_.rotations[i]);
    splats.opacities.push_back(from_.opacities[i]);
    splats.colors.push_back(from_.colors[i]);
    const auto first = from_.harmonics.begin() + static_cast<std::ptrdiff_t>(i * harmonics);
    splats.harmonics.insert(splats.harmonics.end(), first, first + static_cast<std::ptrdiff_t>(harmonics));
    source.push_back(static_cast<std::uint32_t>(i));
  }
  /// Takes two halves along the longest axis.
  void split(std::size_t i) {
    Eigen::Index axis = 0;
    const float size = std::exp(from_.log_scales[i].maxCoeff(&axis));
    const Eigen::Vector3f shift = kSplitShift * size * rotation_of(from_.rotations[i]).col(axis);
    for (const float side : {-1.0f, 1.0f}) {
      take(i);
      splats.positions.back() += side * shift;
      splats.log_scales.back()[axis] += std::log(kSplitScale);
    }
  }
  Splats splats;
  std::vector<std::uint32_t> source;

 private:
  const Splats& from_;
};

}  // namespace

SplatTrainer::SplatTrainer(gpu::Device& device, Splats splats, const std::vector<TrainingView>& views,
                           const TrainerOptions& options)
    : device_(device),
      options_(options),
      rasterizer_(device),
      loss_(device),
      optimizer_(device, upload(device, splats)) {
  for (const TrainingView& v : views) {
    View& view = views_.emplace_back();
    TrainingView smaller = v;
    for (int level = 0; level < options_.levels; ++level) {
      if (level > 0) smaller = halved(smaller);
      view.images.push_back(upload_image(smaller, level));
    }
    view.exposure.head<3>() = v.gain.array().log();
  }
}

SplatTrainer::Image SplatTrainer::upload_image(const TrainingView& view, int level) const {
  // A pixel averages a box of the compared image, whose variance the low pass
  // adds, with the low pass of viewers.
  constexpr double kViewersLowPass = 0.3;  // pixels^2 of the compared image
  const double size = std::ldexp(static_cast<double>(options_.resolution), -level), squared = size * size;
  Image image{.view = {.camera = view.camera,
                       .world_from_camera = view.world_from_camera,
                       .low_pass = static_cast<float>(kViewersLowPass * squared + (1 - squared) / 12)},
              .color = gpu::Buffer(device_, sizeof(std::uint32_t) * view.color.size()),
              .depth = gpu::Buffer(device_, sizeof(float) * view.depth.size())};
  gpu::Batch batch(device_);
  batch.upload(image.color, view.color);
  batch.upload(image.depth, view.depth);
  batch.run();
  return image;
}

/// Level of the images: the smallest first.
std::size_t SplatTrainer::level() const {
  const double share = progress_ / kSmallImages;  // 1: the largest
  const auto levels = static_cast<double>(options_.levels);
  return static_cast<std::size_t>(std::max(0.0, levels - 1 - std::floor(share * (levels - 1))));
}

std::size_t SplatTrainer::next_view() {
  if (order_.empty()) {
    order_.resize(views_.size());
    std::iota(order_.begin(), order_.end(), std::size_t{0});
    for (std::size_t i = order_.size(); i > 1; --i) std::swap(order_[i - 1], order_[random_() % i]);
  }
  const std::size_t next = order_.back();
  order_.pop_back();
  return next;
}

Exposure SplatTrainer::exposure_of(const View& view) const {
  const Eigen::Matrix<float, 6, 1> e = view.exposure - mean_exposure_;
  return {.gain = e.head<3>().array().exp(), .offset = e.tail<3>()};
}

/// Step of Adam. The mean over all images is kept at the identity, as the
/// splats' colors absorb it.
void SplatTrainer::adapt_exposure(View& view, const Exposure& used, const Exposure& gradient) {
  Eigen::Matrix<float, 6, 1> g;
  g << gradient.gain.cwiseProduct(used.gain), gradient.offset;
  ++view.steps;
  view.mean = 0.9f * view.mean + 0.1f * g;
  view.square = 0.999f * view.square + 0.001f * g.cwiseAbs2();
  const float correction1 = 1 - std::pow(0.9f, static_cast<float>(view.steps)),
              correction2 = 1 - std::pow(0.999f, static_cast<float>(view.steps));
  view.exposure.array() -=
      kExposureRate * (view.mean.array() / correction1) / ((view.square.array() / correction2).sqrt() + 1e-12f);
  mean_exposure_.setZero();
  for (const View& v : views_) mean_exposure_ += v.exposure;
  mean_exposure_ /= static_cast<float>(views_.size());
}

SplatRates SplatTrainer::rates() const {
  SplatRates rates;
  rates.position *= static_cast<float>(std::pow(kFinalPositionRate, progress_));
  const auto color = static_cast<float>(std::pow(kFirstColorRate, 1 - progress_));
  rates.color *= color, rates.harmonics *= color;
  return rates;
}

ImageError SplatTrainer::step(double share) {
  progress_ = std::min(1.0, std::max(share, static_cast<double>(steps_) / std::max(1, options_.iterations)));
  View& view = views_[next_view()];
  const Image& image = view.images[level()];
  const Exposure exposure = exposure_of(view);
  rasterizer_.forward(optimizer_.model(), image.view);
  loss_.compare(image.view.camera.width, image.view.camera.height, rasterizer_.image(), image.color, image.depth,
                exposure, {});
  most_entries_ = std::max(most_entries_, rasterizer_.entries());
  rasterizer_.backward(optimizer_.model(), loss_.gradients());
  optimizer_.step(rasterizer_, rates());
  ImageError error = loss_.error();
  adapt_exposure(view, exposure, error.gradient);
  ++steps_;
  if (steps_ % options_.densify_interval == 0 && progress_ < kDensifyEnd) densify();
  return error;
}

void SplatTrainer::densify() {
  const Splats splats = download(device_, optimizer_.model());
  std::vector<float> sums(2 * splats.size());
  gpu::Batch batch(device_);
  batch.download(rasterizer_.motion(), sums);
  batch.run();
  std::vector<std::pair<float, std::size_t>> candidates;  // by decreasing gradient, then by index
  std::vector<bool> is_removed(splats.size());
  std::size_t left = 0;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    is_removed[i] = opacity_of(splats.opacities[i]) < kMinOpacity ||
                    std::exp(splats.log_scales[i].maxCoeff()) > kMaxSplatSize || !splats.positions[i].allFinite();
    left += !is_removed[i];
    const float motion = sums[2 * i + 1] > 0 ? sums[2 * i] / sums[2 * i + 1] : 0;
    if (!is_removed[i] && motion > kMinMotion) candidates.emplace_back(-motion, i);
  }
  std::sort(candidates.begin(), candidates.end());
  const std::size_t room = options_.max_splats > left ? options_.max_splats - left : 0;
  // Smaller images have fewer entries than the largest: four times as many at
  // most.
  const double reserve =
      std::ldexp(static_cast<double>(most_entries_), 2 * static_cast<int>(level())) * kMaxEntryGrowth;
  const bool is_full = reserve > static_cast<double>(rasterizer_.max_entries());
  most_entries_ = 0;
  candidates.resize(
      is_full ? 0
              : std::min({candidates.size(), room, static_cast<std::size_t>(kMaxGrowth * static_cast<float>(left))}));
  std::vector<bool> is_split(splats.size());
  for (const auto& [motion, i] : candidates) is_split[i] = true;
  Picked picked(splats);
  for (std::size_t i = 0; i < splats.size(); ++i)
    if (is_split[i])
      picked.split(i);
    else if (!is_removed[i])
      picked.take(i);
  optimizer_.replace(picked.splats, picked.source);
  rasterizer_.reset_motion(optimizer_.model().count);
}

}  // namespace cairn
