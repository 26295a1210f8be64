// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "splats/image_loss.hpp"
#include "splats/optimizer.hpp"
#include "splats/training_view.hpp"

namespace cairn {

struct TrainerOptions {
  int iterations = 7000;
  std::size_t max_splats = 300000;
  float resolution = 1;        // size of the views relative to the images in which the
                               // splats will be compared
  int densify_interval = 200;  // steps
  int levels = 2;              // sizes of the images: each half of the next, the last the views' own
};

/// Training of splats from images (Kerbl et al. 2023): one image per step in a
/// seeded random order, an exposure per image, and densification by image
/// gradient.
class SplatTrainer {
 public:
  SplatTrainer(gpu::Device& device, Splats splats, const std::vector<TrainingView>& views,
               const TrainerOptions& options);
  /// Trains with the next image. Returns its error before the step. `share`: of
  /// the time for the training that has passed; the schedules follow it or the
  /// share of the iterations, whichever is larger.
  ImageError step(double share = 0);
  [[nodiscard]] std::size_t size() const { return optimizer_.model().count; }
  [[nodiscard]] Splats splats() { return download(device_, optimizer_.model()); }

 private:
  struct Image {
    SplatView view;
    gpu::Buffer color, depth;
  };
  struct View {
    std::vector<Image> images;  // by level, the largest first
    // Exposure as logarithm of the gain, and offset, with its moments of Adam.
    Eigen::Matrix<float, 6, 1> exposure = Eigen::Matrix<float, 6, 1>::Zero(), mean = exposure, square = exposure;
    int steps = 0;
  };
  [[nodiscard]] Image upload_image(const TrainingView& view, int level) const;
  [[nodiscard]] std::size_t next_view();
  [[nodiscard]] std::size_t level() const;
  [[nodiscard]] Exposure exposure_of(const View& view) const;
  void adapt_exposure(View& view, const Exposure& used, const Exposure& gradient);
  [[nodiscard]] SplatRates rates() const;
  void densify();

  gpu::Device& device_;
  TrainerOptions options_;
  SplatRasterizer rasterizer_;
  ImageLoss loss_;
  SplatOptimizer optimizer_;
  std::vector<View> views_;
  Eigen::Matrix<float, 6, 1> mean_exposure_ = Eigen::Matrix<float, 6, 1>::Zero();
  std::vector<std::size_t> order_;  // of the images left in this epoch
  std::minstd_rand random_{1};
  int steps_ = 0;
  std::uint32_t most_entries_ = 0;  // of an image since the last densification
  double progress_ = 0;             // of the schedules, 0 to 1
};

}  // namespace cairn
