// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros/ros_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "base/checked_count.hpp"
#include "base/image_file.hpp"
#include "base/lines.hpp"
#include "base/words.hpp"
#include "geometry/inverse_distortion.hpp"
#include "io/datasets/rvl.hpp"

namespace cairn {
namespace {

using Bytes = std::span<const std::uint8_t>;
constexpr std::uint32_t kMinMosaicSide = 4;  // pixels a side, minimum for OpenCV's demosaicing
constexpr std::uint32_t kMaxSide = 1 << 14;  // pixels a side, of a sensor

/// Sequential reader of message fields. ROS 1 packs them without padding, little-endian; CDR has the byte order in the
/// first four bytes, and aligns each number to its size after them.
class Fields {
 public:
  Fields(Bytes bytes, RosEncoding encoding) : bytes_(bytes), cdr_(encoding == RosEncoding::cdr) {
    if (encoding == RosEncoding::unknown) throw std::runtime_error("is encoded neither in ROS 1 format nor in CDR");
    if (!cdr_) return;
    const Bytes kind = take(4);
    if (kind[0] != 0 || kind[1] > 1) throw std::runtime_error("is CDR of a kind not used by ROS");
    is_swapped_ = (kind[1] == 1) != (std::endian::native == std::endian::little);
  }
  template <class T>
  T number() {
    if (cdr_) (void)take((sizeof(T) - (at_ - 4) % sizeof(T)) % sizeof(T));
    std::array<std::uint8_t, sizeof(T)> raw;
    std::copy_n(take(sizeof(T)).begin(), sizeof(T), raw.begin());
    if (is_swapped_) std::reverse(raw.begin(), raw.end());
    return std::bit_cast<T>(raw);
  }
  template <std::size_t N>
  std::array<double, N> numbers() {
    std::array<double, N> all;
    for (double& value : all) value = number<double>();
    return all;
  }
  Bytes bytes() { return take(number<std::uint32_t>()); }
  std::string text() {
    Bytes all = bytes();
    if (cdr_ && !all.empty() && all.back() == 0) all = all.first(all.size() - 1);
    return {all.begin(), all.end()};
  }
  /// Reads the length of a list with entries of `min` bytes or more.
  std::uint32_t length(std::size_t min) {
    const auto count = number<std::uint32_t>();
    if (count > (bytes_.size() - at_) / min) throw std::runtime_error("ends too early");
    return count;
  }
  RosHeader header() {
    if (!cdr_) (void)number<std::uint32_t>();  // sequence number
    const double seconds = cdr_ ? number<std::int32_t>() : number<std::uint32_t>();
    RosHeader header{.stamp = seconds + 1e-9 * number<std::uint32_t>(), .frame_id = text()};
    header.frame_id.erase(0, std::min(header.frame_id.find_first_not_of('/'), header.frame_id.size()));
    return header;
  }
  Eigen::Vector3d vector() {
    const auto v = numbers<3>();
    return {v[0], v[1], v[2]};
  }
  Eigen::Isometry3d transform() {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = vector();
    const auto q = numbers<4>();
    const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
    if (!is_rotation(rotation) || !pose.translation().allFinite())
      throw std::runtime_error("is not a rotation and translation");
    pose.linear() = rotation.normalized().toRotationMatrix();
    return pose;
  }

 private:
  Bytes take(std::size_t size) {
    if (size > bytes_.size() - at_) throw std::runtime_error("ends too early");
    at_ += size;
    return bytes_.subspan(at_ - size, size);
  }
  Bytes bytes_;
  std::size_t at_ = 0;
  bool cdr_, is_swapped_ = false;
};

/// Memory layout and kind of a sensor_msgs/Image encoding.
struct Layout {
  std::string_view encoding;
  RosImage::Kind kind;
  int type, to_rgba;
};
constexpr std::array kLayouts{
    Layout{"16UC1", RosImage::Kind::depth, CV_16UC1, -1},
    Layout{"mono16", RosImage::Kind::depth, CV_16UC1, -1},
    Layout{"32FC1", RosImage::Kind::depth, CV_32FC1, -1},
    Layout{"rgb8", RosImage::Kind::color, CV_8UC3, cv::COLOR_RGB2RGBA},
    Layout{"bgr8", RosImage::Kind::color, CV_8UC3, cv::COLOR_BGR2RGBA},
    Layout{"8UC3", RosImage::Kind::color, CV_8UC3, cv::COLOR_BGR2RGBA},
    Layout{"rgba8", RosImage::Kind::color, CV_8UC4, -1},
    Layout{"bgra8", RosImage::Kind::color, CV_8UC4, cv::COLOR_BGRA2RGBA},
    Layout{"8UC4", RosImage::Kind::color, CV_8UC4, cv::COLOR_BGRA2RGBA},
    Layout{"mono8", RosImage::Kind::gray, CV_8UC1, cv::COLOR_GRAY2RGBA},
    Layout{"8UC1", RosImage::Kind::gray, CV_8UC1, cv::COLOR_GRAY2RGBA},
    Layout{"yuv422", RosImage::Kind::color, CV_8UC2, cv::COLOR_YUV2RGBA_UYVY},
    Layout{"uyvy", RosImage::Kind::color, CV_8UC2, cv::COLOR_YUV2RGBA_UYVY},
    Layout{"UYVY", RosImage::Kind::color, CV_8UC2, cv::COLOR_YUV2RGBA_UYVY},
    Layout{"yuv422_yuy2", RosImage::Kind::color, CV_8UC2, cv::COLOR_YUV2RGBA_YUY2},
    Layout{"yuyv", RosImage::Kind::color, CV_8UC2, cv::COLOR_YUV2RGBA_YUY2},
    Layout{"YUYV", RosImage::Kind::color, CV_8UC2, cv::COLOR_YUV2RGBA_YUY2},
    // OpenCV names a pattern by its second row and column.
    Layout{"bayer_rggb8", RosImage::Kind::color, CV_8UC1, cv::COLOR_BayerBG2RGBA},
    Layout{"bayer_bggr8", RosImage::Kind::color, CV_8UC1, cv::COLOR_BayerRG2RGBA},
    Layout{"bayer_gbrg8", RosImage::Kind::color, CV_8UC1, cv::COLOR_BayerGR2RGBA},
    Layout{"bayer_grbg8", RosImage::Kind::color, CV_8UC1, cv::COLOR_BayerGB2RGBA},
};

bool is_yuv422(const Layout& layout) { return layout.type == CV_8UC2; }
bool is_mosaic(const Layout& layout) { return layout.encoding.starts_with("bayer"); }

/// Stored columns of a row. Two pixels of YUV 4:2:2 share their color, so a row of odd width ends in half a pair.
std::uint32_t stored_columns(const Layout& layout, std::uint32_t width) {
  return is_yuv422(layout) ? width + width % 2 : width;
}

RosImage raw_image(Fields& fields, const ImageBound& bound) {
  const auto height = fields.number<std::uint32_t>(), width = fields.number<std::uint32_t>();
  RosImage image{.encoding = shown(fields.text()), .pixels = {}};
  const bool big_endian = fields.number<std::uint8_t>() != 0;
  const auto step = fields.number<std::uint32_t>();
  const Bytes data = fields.bytes();
  const auto layout =
      std::find_if(kLayouts.begin(), kLayouts.end(), [&](const Layout& l) { return l.encoding == image.encoding; });
  if (layout == kLayouts.end()) return image;
  check_image_size(width, height, bound);
  const std::uint32_t columns = stored_columns(*layout, width);
  const std::uint64_t row = product(columns, CV_ELEM_SIZE(layout->type));
  if (step < row || !fits(height - 1, step, data.size(), row))
    throw std::runtime_error(
        fmt::format("is an image of {}x{} pixels as {} with {} bytes per row, but has {} bytes{}", width, height,
                    image.encoding, step, data.size(),
                    is_yuv422(*layout) && width % 2 != 0
                        ? "; its pixels are stored in pairs, so a row of odd width needs two more bytes"
                        : ""));
  if (is_mosaic(*layout) && (width < kMinMosaicSide || height < kMinMosaicSide))
    throw std::runtime_error(fmt::format("is an image of {}x{} pixels as {}, too small for its color pattern", width,
                                         height, image.encoding));
  const std::size_t size = CV_ELEM_SIZE1(layout->type);
  if (step % size != 0)
    throw std::runtime_error(fmt::format("has rows of {} bytes, not a multiple of its {}-byte values", step, size));
  image.kind = layout->kind;
  image.to_rgba = layout->to_rgba;
  image.width = static_cast<int>(width);
  image.pixels = cv::Mat(static_cast<int>(height), static_cast<int>(columns), layout->type,
                         const_cast<std::uint8_t*>(data.data()), step);
  if (size > 1) {  // data may be unaligned and in the other byte order
    image.pixels = image.pixels.clone();
    if (big_endian)
      for (std::uint8_t* p = image.pixels.data; p != image.pixels.data + image.pixels.total() * size; p += size)
        std::reverse(p, p + size);
  }
  return image;
}

/// Decodes RVL of compressed_depth_image_transport: width, height, and the pixels.
cv::Mat rvl_image(Bytes data, const ImageBound& bound) {
  std::array<std::uint32_t, 2> size{};
  if (data.size() < sizeof size) throw std::runtime_error("ends too early");
  std::memcpy(size.data(), data.data(), sizeof size);
  check_image_size(size[0], size[1], bound);
  auto pixels = decode_rvl(data.subspan(sizeof size), product(size[0], size[1]));
  return cv::Mat(static_cast<int>(size[1]), static_cast<int>(size[0]), CV_16UC1, pixels.data()).clone();
}

/// Decodes image_transport data: PNG, JPEG or RVL; with `compressedDepth`, three numbers first, with the quantization
/// of meters to 16 bits.
RosImage packed_image(Fields& fields, const ImageBound& bound) {
  const std::string format = fields.text();
  Bytes data = fields.bytes();
  RosImage image{.encoding = shown(format), .pixels = {}};
  if (format.find("compressedDepth") != format.npos) {
    constexpr std::size_t kFront = 12;
    if (data.size() < kFront) throw std::runtime_error("ends too early");
    std::memcpy(&image.quant_a, data.data() + 4, 4);
    std::memcpy(&image.quant_b, data.data() + 8, 4);
    image.packed_from_meters = format.starts_with("32FC1");
    data = data.subspan(kFront);
  }
  const bool is_rvl = format.find("compressedDepth rvl") != format.npos;
  image.pixels = is_rvl ? rvl_image(data, bound) : decode_image(data, Pixels::as_stored, bound);
  image.width = image.pixels.cols;
  switch (image.pixels.type()) {
    case CV_16UC1:
      image.kind = RosImage::Kind::depth;
      break;
    case CV_8UC1:
      image.kind = RosImage::Kind::gray, image.to_rgba = cv::COLOR_GRAY2RGBA;
      break;
    case CV_8UC3:
      image.kind = RosImage::Kind::color, image.to_rgba = cv::COLOR_RGB2RGBA;
      break;
    default:
      break;
  }
  return image;
}

void set_lens(const RosCameraInfo& info, Camera& camera) {
  const std::vector<double>& d = info.d;
  if (std::all_of(d.begin(), d.end(), [](double k) { return k == 0; })) {
    if (info.distortion_model == "equidistant" || info.distortion_model == "fisheye") camera.lens = Lens::fisheye;
    return;
  }
  const std::string model = shown(info.distortion_model);
  const auto need = [&](std::size_t min, std::size_t max) {
    if (d.size() < min || d.size() > max)
      throw std::runtime_error(
          fmt::format("its distortion has {} coefficients, the model '{}' takes {} to {}", d.size(), model, min, max));
  };
  if (model == "plumb_bob" || model == "rational_polynomial" || model == "Brown Conrady" ||
      model == "Modified Brown Conrady") {
    need(4, 14);
    // Coefficients after the eighth: thin prism and tilted sensor.
    if (d.size() > 8 && std::any_of(d.begin() + 8, d.end(), [](double k) { return k != 0; }))
      throw std::runtime_error("its distortion has thin-prism terms, which are not supported");
    std::copy_n(d.begin(), std::min<std::size_t>(d.size(), 8), camera.distortion.begin());
  } else if (model == "Inverse Brown Conrady") {
    need(5, 5);
    camera.distortion = invert_distortion(camera, {d[0], d[1], d[2], d[3], d[4]});
  } else if (model == "equidistant" || model == "fisheye" || model == "Kannala Brandt4") {
    need(4, 5);
    camera.lens = Lens::fisheye;
    std::copy_n(d.begin(), 4, camera.distortion.begin());
  } else {
    throw std::runtime_error(
        fmt::format("its distortion model is '{}', expected plumb_bob, rational_polynomial or equidistant", model));
  }
}

}  // namespace

RosHeader read_ros_header(Bytes bytes, RosEncoding encoding) { return Fields(bytes, encoding).header(); }

RosImage read_ros_image(Bytes bytes, RosEncoding encoding, std::string_view type, const ImageBound& bound) {
  Fields fields(bytes, encoding);
  (void)fields.header();
  return type == "sensor_msgs/Image" ? raw_image(fields, bound) : packed_image(fields, bound);
}

std::vector<float> depth_of(const RosImage& image, double unit) {
  std::vector<float> depth(image.pixels.total());
  const auto meters = static_cast<float>(unit);
  bool any = false;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    float z = 0;
    if (image.pixels.type() == CV_32FC1) {
      z = image.pixels.at<float>(static_cast<int>(i));
    } else if (const std::uint16_t value = image.pixels.at<std::uint16_t>(static_cast<int>(i)); value != 0) {
      z = image.packed_from_meters ? image.quant_a / (static_cast<float>(value) - image.quant_b)
                                   : static_cast<float>(value) * meters;
    }
    depth[i] = std::isfinite(z) && z > 0 ? z : 0.0f;
    any |= depth[i] > 0;
  }
  if (!any) throw std::runtime_error("holds no measurement");
  return depth;
}

std::vector<std::uint32_t> color_of(const RosImage& image) {
  cv::Mat rgba;
  if (image.to_rgba >= 0)
    cv::cvtColor(image.pixels, rgba, image.to_rgba);
  else
    rgba = image.pixels.clone();
  if (rgba.cols != image.width) rgba = rgba.colRange(0, image.width).clone();  // drop the second half of the last pair
  const auto* data = rgba.ptr<std::uint32_t>();
  std::vector<std::uint32_t> color(data, data + rgba.total());
  for (std::uint32_t& pixel : color) pixel |= 0xff000000u;
  return color;
}

RosCameraInfo read_camera_info(Bytes bytes, RosEncoding encoding) {
  Fields fields(bytes, encoding);
  RosCameraInfo info{.header = fields.header()};
  const auto height = fields.number<std::uint32_t>(), width = fields.number<std::uint32_t>();
  info.width = static_cast<int>(std::min(width, kMaxSide));
  info.height = static_cast<int>(std::min(height, kMaxSide));
  info.distortion_model = fields.text();
  info.d.resize(fields.length(sizeof(double)));
  for (double& value : info.d) value = fields.number<double>();
  info.k = fields.numbers<9>();
  (void)fields.numbers<9>();  // rectification rotation of a stereo pair
  info.p = fields.numbers<12>();
  info.binning_x = fields.number<std::uint32_t>();
  info.binning_y = fields.number<std::uint32_t>();
  info.left = fields.number<std::uint32_t>();
  info.top = fields.number<std::uint32_t>();
  info.roi_height = fields.number<std::uint32_t>();
  info.roi_width = fields.number<std::uint32_t>();
  return info;
}

Camera camera_of(const RosCameraInfo& info, bool rectified) {
  const bool by_p = rectified && info.p[0] != 0;
  Camera c{.width = info.width, .height = info.height};
  c.fx = by_p ? info.p[0] : info.k[0], c.fy = by_p ? info.p[5] : info.k[4];
  c.cx = by_p ? info.p[2] : info.k[2], c.cy = by_p ? info.p[6] : info.k[5];
  if (c.fx == 0) throw std::runtime_error("its K is zero: the camera was never calibrated");
  if (!rectified) set_lens(info, c);
  // Region of interest and binning.
  if (info.roi_width > 0 && info.roi_height > 0) {
    c.width = static_cast<int>(std::min(info.roi_width, kMaxSide));
    c.height = static_cast<int>(std::min(info.roi_height, kMaxSide));
    c.cx -= info.left, c.cy -= info.top;
  }
  const int bx = static_cast<int>(std::clamp(info.binning_x, 1u, 64u)),
            by = static_cast<int>(std::clamp(info.binning_y, 1u, 64u));
  c.width /= bx, c.height /= by;
  c.fx /= bx, c.fy /= by;
  c.cx = (c.cx + 0.5) / bx - 0.5, c.cy = (c.cy + 0.5) / by - 0.5;
  check(c);
  return c;
}

RosImu read_imu(Bytes bytes, RosEncoding encoding) {
  Fields fields(bytes, encoding);
  (void)fields.header();
  (void)fields.numbers<4 + 9>();  // orientation and its covariance
  const auto measured = [&]() -> std::optional<Eigen::Vector3d> {
    const Eigen::Vector3d value = fields.vector();
    const auto covariance = fields.numbers<9>();
    // ROS marks unmeasured values by -1; other drivers write zeros.
    if (covariance[0] == -1 || value.isZero(0) || !value.allFinite()) return std::nullopt;
    return value;
  };
  RosImu imu;
  imu.rate = measured();
  imu.acceleration = measured();
  return imu;
}

std::vector<RosTransform> read_tf(Bytes bytes, RosEncoding encoding) {
  Fields fields(bytes, encoding);
  std::vector<RosTransform> all(fields.length(64));
  for (RosTransform& transform : all) {
    transform.parent = fields.header().frame_id;
    transform.child = fields.text();
    transform.child.erase(0, std::min(transform.child.find_first_not_of('/'), transform.child.size()));
    transform.parent_from_child = fields.transform();
  }
  return all;
}

Eigen::Isometry3d read_transform(Bytes bytes, RosEncoding encoding) { return Fields(bytes, encoding).transform(); }

float read_float(Bytes bytes, RosEncoding encoding) { return Fields(bytes, encoding).number<float>(); }

std::pair<std::string, std::string> read_key_value(Bytes bytes, RosEncoding encoding) {
  Fields fields(bytes, encoding);
  std::string key = fields.text();
  return {std::move(key), fields.text()};
}

}  // namespace cairn
