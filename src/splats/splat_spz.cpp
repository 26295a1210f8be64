// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// SPZ (Niantic, https://github.com/nianticlabs/spz): a gzip file of a header and a plane of quantized values per
// attribute, in the axes right, up, back. Version 3 is written, 2 and 3 are read.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "base/gzip.hpp"
#include "base/little_endian.hpp"
#include "splats/formats.hpp"

namespace cairn {
namespace {

constexpr std::uint32_t kMagic = 0x5053474e;  // NGSP
constexpr std::size_t kHeaderSize = 16;
constexpr std::uint32_t kFirstThree = 2, kSmallestThree = 3;  // versions, by their quaternions
constexpr int kUsualFractionBits = 12, kMaxFractionBits = 23;
constexpr float kColorScale = 0.15f;
constexpr float kScaleSteps = 16, kScaleOffset = 10;           // of the logarithm
constexpr int kFirstBandStep = 8, kOtherBandsStep = 16;        // of 256: harmonics of degree 1, and above
constexpr std::uint32_t kComponentMask = 511, kSignBit = 512;  // of the smallest three components
constexpr int kComponentBits = 10;
constexpr float kMinOpacity = 1 / 255.0f;  // and its complement: finite logits

const Eigen::Vector3f kAxisSigns(1, -1, -1);

struct Header {
  std::uint32_t version = kSmallestThree, count = 0;
  int degree = 0, fraction_bits = kUsualFractionBits;
};

/// Offsets of the planes in the decompressed file.
struct Layout {
  std::size_t positions, opacities, colors, scales, rotations, harmonics, size, bytes_per_rotation;
};

Layout layout_of(const Header& header) {
  const std::size_t n = header.count, rotation = header.version == kFirstThree ? 3 : 4;
  Layout l{};
  l.bytes_per_rotation = rotation;
  l.positions = kHeaderSize;
  l.opacities = l.positions + 9 * n;
  l.colors = l.opacities + n;
  l.scales = l.colors + 3 * n;
  l.rotations = l.scales + 3 * n;
  l.harmonics = l.rotations + rotation * n;
  l.size = l.harmonics + 3 * harmonics_per_splat(header.degree) * n;
  return l;
}

std::uint8_t byte_of(float value) { return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0f, 255.0f))); }

/// Largest usual number of fractional bits at which all coordinates fit into 24 bits.
int fraction_bits_of(const Splats& splats) {
  constexpr float kMaxFixed = (1 << 23) - 1;
  float largest = 0;
  for (const Eigen::Vector3f& p : splats.positions) largest = std::max(largest, p.cwiseAbs().maxCoeff());
  for (int bits = kUsualFractionBits; bits >= 0; --bits)
    if (std::ldexp(largest, bits) <= kMaxFixed) return bits;
  throw std::runtime_error("a splat is " + std::to_string(largest) + " m from the origin, too far for SPZ: use .ply");
}

void put_little_endian(std::string& bytes, std::uint32_t value, int count) {
  for (int k = 0; k < count; ++k) bytes.push_back(static_cast<char>(value >> (8 * k) & 255));
}

/// Index x, y, z, w of the largest component in the upper two bits; sign and 9 bits of each other component.
std::uint32_t pack_rotation(const Eigen::Vector4f& wxyz) {
  Eigen::Vector4f q = y_up_rotation(wxyz);
  Eigen::Index largest = 0;
  q.cwiseAbs().maxCoeff(&largest);
  if (q[largest] < 0) q = -q;
  auto packed = static_cast<std::uint32_t>(largest);
  for (Eigen::Index k = 0; k < 4; ++k) {
    if (k == largest) continue;
    const auto magnitude = static_cast<std::uint32_t>(std::lround(
        static_cast<float>(kComponentMask) * std::min(1.0f, std::abs(q[k]) * std::numbers::sqrt2_v<float>)));
    packed = packed << kComponentBits | (q[k] < 0 ? kSignBit : 0) | magnitude;
  }
  return packed;
}

Eigen::Vector4f unpack_rotation(std::uint32_t packed) {
  const Eigen::Index largest = packed >> 30;
  Eigen::Vector4f q = Eigen::Vector4f::Zero();
  for (Eigen::Index k = 3; k >= 0; --k) {
    if (k == largest) continue;
    const float magnitude =
        static_cast<float>(packed & kComponentMask) / static_cast<float>(kComponentMask) / std::numbers::sqrt2_v<float>;
    q[k] = (packed & kSignBit) != 0 ? -magnitude : magnitude;
    packed >>= kComponentBits;
  }
  q[largest] = std::sqrt(std::max(0.0f, 1 - q.squaredNorm()));
  return {q[3], q[0], -q[1], -q[2]};
}

Eigen::Vector4f unpack_first_three(const std::uint8_t* bytes) {
  Eigen::Vector3f q;
  for (int k = 0; k < 3; ++k) q[k] = static_cast<float>(bytes[k]) / 127.5f - 1;
  const float w = std::sqrt(std::max(0.0f, 1 - q.squaredNorm()));
  return {w, q[0], -q[1], -q[2]};
}

std::uint8_t pack_harmonic(float value, int step) {
  const auto level = static_cast<int>(std::lround(std::clamp(value, -2.0f, 2.0f) * 128)) + 128;
  return static_cast<std::uint8_t>(std::clamp((level + step / 2) / step * step, 0, 255));
}

Header read_header(std::span<const std::uint8_t> file) {
  constexpr std::array<std::uint8_t, 4> kPlain = {'N', 'G', 'S', 'P'};
  if (file.size() >= 4 && std::equal(kPlain.begin(), kPlain.end(), file.begin()))
    throw std::runtime_error("SPZ of version 4 is not supported: save it as version 3, or as .ply");
  if (file.size() < 2 || file[0] != 0x1f || file[1] != 0x8b) throw std::runtime_error("is not an SPZ file");
  const std::vector<std::uint8_t> bytes = gunzip(file, kHeaderSize);
  if (bytes.size() < kHeaderSize) throw std::runtime_error("the file is cut off");
  const auto word = [&](std::size_t k) {
    return little_endian_uint32(std::span<const std::uint8_t, 4>(bytes.data() + 4 * k, 4));
  };
  if (word(0) != kMagic) throw std::runtime_error("is not an SPZ file");
  const Header header{.version = word(1), .count = word(2), .degree = bytes[12], .fraction_bits = bytes[13]};
  if (header.version != kFirstThree && header.version != kSmallestThree)
    throw std::runtime_error("SPZ of version " + std::to_string(header.version) + " is not supported: use 2 or 3");
  if (header.degree > 3)
    throw std::runtime_error("its spherical harmonics of degree " + std::to_string(header.degree) +
                             " are not supported: up to 3");
  if (header.fraction_bits > kMaxFractionBits)
    throw std::runtime_error(std::to_string(header.fraction_bits) + " fractional bits do not fit into 24");
  if (header.count == 0) throw std::runtime_error("has no splats");
  return header;
}

}  // namespace

std::string spz_of(const Splats& splats) {
  const Header header{.count = static_cast<std::uint32_t>(splats.size()),
                      .degree = splats.degree,
                      .fraction_bits = fraction_bits_of(splats)};
  std::string bytes;
  bytes.reserve(layout_of(header).size);
  for (const std::uint32_t word : {kMagic, header.version, header.count}) put_little_endian(bytes, word, 4);
  put_little_endian(bytes, static_cast<std::uint32_t>(header.degree | header.fraction_bits << 8), 4);
  const auto put = [&](float value) { bytes.push_back(static_cast<char>(byte_of(value))); };
  for (const Eigen::Vector3f& position : splats.positions)
    for (const float value : position.cwiseProduct(kAxisSigns))
      put_little_endian(bytes, static_cast<std::uint32_t>(std::lround(std::ldexp(value, header.fraction_bits))), 3);
  for (const float logit : splats.opacities) put(255 / (1 + std::exp(-logit)));
  for (const Eigen::Vector3f& color : splats.colors)
    for (const float value : color) put(255 * (kColorScale * value + 0.5f));
  for (const Eigen::Vector3f& scale : splats.log_scales)
    for (const float value : scale) put(kScaleSteps * (value + kScaleOffset));
  for (const Eigen::Vector4f& rotation : splats.rotations) put_little_endian(bytes, pack_rotation(rotation), 4);
  const std::size_t harmonics = harmonics_per_splat(splats.degree);
  for (std::size_t i = 0; i < splats.harmonics.size(); ++i) {
    const std::size_t k = i % harmonics;
    for (const float value : splats.harmonics[i])
      bytes.push_back(static_cast<char>(
          pack_harmonic(kYUpHarmonicSigns[k] * value, k < harmonics_per_splat(1) ? kFirstBandStep : kOtherBandsStep)));
  }
  return gzip(bytes);
}

Splats read_spz(std::span<const std::uint8_t> file) {
  const Header header = read_header(file);
  const Layout at = layout_of(header);
  const std::vector<std::uint8_t> bytes = gunzip(file, at.size + 1);  // one more, to check the sum at the end
  if (bytes.size() < at.size)
    throw std::runtime_error("the file is cut off: its " + std::to_string(header.count) + " splats are " +
                             std::to_string(at.size) + " bytes, and " + std::to_string(bytes.size()) + " are here");
  Splats splats;
  splats.degree = header.degree;
  const std::size_t harmonics = harmonics_per_splat(header.degree);
  const auto vector = [&](std::size_t plane, std::size_t i) {
    const std::uint8_t* b = bytes.data() + plane + 3 * i;
    return Eigen::Vector3f(b[0], b[1], b[2]);
  };
  for (std::size_t i = 0; i < header.count; ++i) {
    Eigen::Vector3f position;
    for (int k = 0; k < 3; ++k) {
      const std::uint8_t* b = bytes.data() + at.positions + 9 * i + 3 * static_cast<std::size_t>(k);
      const auto sign_extended = static_cast<std::int32_t>(static_cast<std::uint32_t>(b[2]) << 24 |
                                                           static_cast<std::uint32_t>(b[1]) << 16 | b[0] << 8) >>
                                 8;
      position[k] = std::ldexp(static_cast<float>(sign_extended), -header.fraction_bits);
    }
    splats.positions.emplace_back(position.cwiseProduct(kAxisSigns));
    const float opacity = std::clamp(static_cast<float>(bytes[at.opacities + i]) / 255, kMinOpacity, 1 - kMinOpacity);
    splats.opacities.push_back(std::log(opacity / (1 - opacity)));
    splats.colors.emplace_back((vector(at.colors, i).array() / 255 - 0.5f) / kColorScale);
    splats.log_scales.emplace_back(vector(at.scales, i).array() / kScaleSteps - kScaleOffset);
    const std::uint8_t* rotation = bytes.data() + at.rotations + at.bytes_per_rotation * i;
    splats.rotations.push_back(header.version == kFirstThree ? unpack_first_three(rotation)
                                                             : unpack_rotation(little_endian_uint32(
                                                                   std::span<const std::uint8_t, 4>(rotation, 4))));
    for (std::size_t k = 0; k < harmonics; ++k)
      splats.harmonics.emplace_back(kYUpHarmonicSigns[k] * (vector(at.harmonics, i * harmonics + k).array() - 128) /
                                    128);
  }
  return splats;
}

}  // namespace cairn
