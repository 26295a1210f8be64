// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <array>

namespace cairn {

/// How a lens bends rays.
enum class Lens {
  brown_conrady,  ///< Brown 1971 with the rational terms of OpenCV: k1 k2 p1 p2 k3 k4 k5 k6
  fisheye         ///< Kannala & Brandt 2006, as OpenCV's fisheye: k1 k2 k3 k4, then zeros
};

/// Pinhole camera with a lens. The camera frame is x right, y down, z forward; pixel (0, 0) is the centre of the upper
/// left pixel.
struct Camera {
  int width = 640;                                        ///< pixels
  int height = 480;                                       ///< pixels
  double fx = 525.0, fy = 525.0, cx = 319.5, cy = 239.5;  ///< pixels; fy > 0, sources turn images that have it negative
  std::array<double, 8> distortion{};                     ///< see Lens; of Brown's all zero: images are rectified
  Lens lens = Lens::brown_conrady;
  double readout = 0;  ///< seconds from the first row to the last, around a frame's time; 0: a global shutter

  friend bool operator==(const Camera&, const Camera&) = default;
  [[nodiscard]] bool distorted() const { return lens == Lens::fisheye || distortion != std::array<double, 8>{}; }
  /// Seconds after a frame's time at which a row is taken.
  [[nodiscard]] double row_delay(double row) const { return readout * ((row + 0.5) / height - 0.5); }
  /// The camera of its images once lens and shutter are undone.
  [[nodiscard]] Camera rectified() const {
    Camera c = *this;
    c.distortion = {};
    c.lens = Lens::brown_conrady;
    c.readout = 0;
    return c;
  }
  /// Direction with z = 1 of the ray through an undistorted pixel.
  [[nodiscard]] Eigen::Vector3d ray(double u, double v) const { return {(u - cx) / fx, (v - cy) / fy, 1.0}; }
  /// Undistorted pixel of a point in the camera frame with z > 0.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& p) const {
    return {fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy};
  }
  /// Where the lens takes a ray (x, y, 1), at z = 1.
  [[nodiscard]] Eigen::Vector2d distort(const Eigen::Vector2d& ray) const;
  /// The ray (x, y, 1) of a measured pixel: distort() turned round, by iteration.
  [[nodiscard]] Eigen::Vector2d undistorted_ray(double u, double v) const;
  /// Up to where the lens bends rays apart: the tangent of the angle to the axis, at most a little beyond the image.
  [[nodiscard]] double widest_ray() const;
  /// The same camera at 1/2^level of the resolution; pixel (i, j) covers the 2^level block that starts at 2^level (i,
  /// j).
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

/// Throws std::runtime_error naming the field, its value and what is allowed, for a camera that no image can be of: a
/// size out of 16..4096 pixels, a focal length out of a twentieth to twenty times the larger side, a principal point
/// farther than one image beside the image, or what is not a number.
void check(const Camera& camera);

/// How well corners in views turned against each other fit other focal lengths: a systematic error tells of wrong
/// intrinsics.
struct FocalEvidence {
  double scale = 1;                        ///< the length that fits best, in units of the camera's
  double error_given = 0, error_best = 0;  ///< pixels, root mean square over the corners
  int pairs = 0;                           ///< of views; 0: too few to tell
  /// Whether the camera's intrinsics are in doubt.
  [[nodiscard]] bool contradicts() const {
    return pairs > 0 && (scale < 0.97 || scale > 1.03) && error_given > 1.03 * error_best;
  }
};

}  // namespace cairn
