// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <array>

namespace cairn {

/// Lens distortion model.
enum class Lens {
  brown_conrady,  ///< Brown 1971 with the rational terms of OpenCV: k1 k2 p1 p2 k3 k4 k5 k6
  fisheye         ///< Kannala & Brandt 2006, as OpenCV's fisheye: k1 k2 k3 k4, then zeros
};

/// Pinhole camera with a lens. Camera frame: x right, y down, z forward; pixel (0, 0) is the center of the upper left
/// pixel.
struct Camera {
  int width = 640;                                        ///< pixels
  int height = 480;                                       ///< pixels
  double fx = 525.0, fy = 525.0, cx = 319.5, cy = 239.5;  ///< pixels; fy > 0, sources flip images with a negative fy
  std::array<double, 8> distortion{};                     ///< coefficients of the Lens; all zero for brown_conrady:
                                                          ///< rectified images
  Lens lens = Lens::brown_conrady;
  double readout = 0;  ///< seconds from the first row to the last, centered on a frame's time; 0: global shutter

  friend bool operator==(const Camera&, const Camera&) = default;
  [[nodiscard]] bool distorted() const { return lens == Lens::fisheye || distortion != std::array<double, 8>{}; }
  /// Seconds from a frame's time to the exposure of a row; negative for the upper half.
  [[nodiscard]] double row_delay(double row) const { return readout * ((row + 0.5) / height - 0.5); }
  /// Camera of the images after lens and shutter correction.
  [[nodiscard]] Camera rectified() const {
    Camera c = *this;
    c.distortion = {};
    c.lens = Lens::brown_conrady;
    c.readout = 0;
    return c;
  }
  /// Direction, with z = 1, of the ray through an undistorted pixel.
  [[nodiscard]] Eigen::Vector3d ray(double u, double v) const { return {(u - cx) / fx, (v - cy) / fy, 1.0}; }
  /// Undistorted pixel of a point in the camera frame with z > 0.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& p) const {
    return {fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy};
  }
  /// Applies the lens distortion to a ray (x, y, 1); returns its x and y at z = 1.
  [[nodiscard]] Eigen::Vector2d distort(const Eigen::Vector2d& ray) const;
  /// Ray (x, y, 1) of a measured pixel: the inverse of distort(), found by iteration.
  [[nodiscard]] Eigen::Vector2d undistorted_ray(double u, double v) const;
  /// Limit of the range in which distort() is injective: tangent of the angle to the axis, at most slightly beyond the
  /// image.
  [[nodiscard]] double widest_ray() const;
  /// Camera at 1/2^level of the resolution; pixel (i, j) covers the 2^level block that starts at 2^level (i, j).
  [[nodiscard]] Camera at_level(int level) const {
    const double s = 1.0 / (1 << level);
    Camera c = *this;
    c.width = width >> level;
    c.height = height >> level;
    c.fx = fx * s;
    c.fy = fy * s;
    c.cx = (cx + 0.5) * s - 0.5;
    c.cy = (cy + 0.5) * s - 0.5;
    return c;
  }
};

/// Throws std::runtime_error naming the field, its value and the allowed range, for an impossible camera: size outside
/// 16..4096 pixels, focal length outside a twentieth to twenty times the larger side, principal point more than one
/// image size outside the image, or a value that is not finite.
void check(const Camera& camera);

/// Reprojection error of features in rotated views as a function of focal length. A systematic error indicates wrong
/// intrinsics.
struct FocalEvidence {
  double scale = 1;                        ///< focal length with the smallest error, relative to the camera's
  double error_given = 0, error_best = 0;  ///< pixels, root mean square over the features
  int pairs = 0;                           ///< pairs of views; 0: not enough for an estimate
  /// True if the camera's intrinsics are in doubt.
  [[nodiscard]] bool contradicts() const {
    return pairs > 0 && (scale < 0.97 || scale > 1.03) && error_given > 1.03 * error_best;
  }
};

}  // namespace cairn
