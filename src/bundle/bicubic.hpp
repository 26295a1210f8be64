// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Bicubic interpolation of brightness (Catmull & Rom 1974), with continuous slopes.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace cairn {

class Bicubic {
 public:
  /// Reads the neighborhood of a pixel: one pixel before and two after, in each direction.
  Bicubic(const std::vector<std::uint8_t>& image, int width, const Eigen::Vector2d& pixel) {
    const Eigen::Vector2d first_pixel = pixel.array().floor();
    share_ = pixel - first_pixel;
    const std::uint8_t* first =
        image.data() + (static_cast<int>(first_pixel.y()) - 1) * width + static_cast<int>(first_pixel.x()) - 1;
    for (int row = 0; row < 4; ++row)
      values_.row(row) = Eigen::Map<const Eigen::Matrix<std::uint8_t, 1, 4>>(first + row * width).cast<double>();
  }
  [[nodiscard]] double value() const { return weights(share_.y()).dot(values_ * weights(share_.x())); }
  /// Derivative of the value by the pixel position (x, y).
  [[nodiscard]] Eigen::Vector2d slope() const {
    return {weights(share_.y()).dot(values_ * slopes(share_.x())),
            slopes(share_.y()).dot(values_ * weights(share_.x()))};
  }

 private:
  static Eigen::Vector4d weights(double x) {
    return {x * (-0.5 + x * (1 - 0.5 * x)), 1 + x * x * (-2.5 + 1.5 * x), x * (0.5 + x * (2 - 1.5 * x)),
            x * x * (-0.5 + 0.5 * x)};
  }
  static Eigen::Vector4d slopes(double x) {
    return {-0.5 + x * (2 - 1.5 * x), x * (-5 + 4.5 * x), 0.5 + x * (4 - 4.5 * x), x * (-1 + 1.5 * x)};
  }
  Eigen::Vector2d share_;
  Eigen::Matrix4d values_;
};

}  // namespace cairn
