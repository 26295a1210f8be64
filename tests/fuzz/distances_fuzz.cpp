// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// DistanceField::read of a .vdb with blocks, transform and values from the input, followed by queries.
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>

#include "cairn/mapping/esdf.hpp"
#include "fuzz.hpp"

using namespace cairn;

namespace {

/// Numbers from the input, zero after its end.
class Numbers {
 public:
  Numbers(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  template <class T>
  T next() {
    T value{};
    const std::size_t count = std::min(sizeof(T), size_);
    std::memcpy(&value, data_, count);
    data_ += count, size_ -= count;
    return value;
  }
  [[nodiscard]] bool any() const { return size_ > 0; }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

Eigen::Vector3f vector(Numbers& numbers) {
  return {numbers.next<float>(), numbers.next<float>(), numbers.next<float>()};
}

DistanceField field_of(Numbers& numbers) {
  constexpr std::size_t kMaxBlocks = 12;
  const auto voxel_size = numbers.next<float>(), max_distance = numbers.next<float>();
  const Eigen::Vector3f origin = vector(numbers);
  Eigen::Quaternionf rotation(1, numbers.next<std::int8_t>() / 127.0f, numbers.next<std::int8_t>() / 127.0f, 0);
  DistanceField::Blocks blocks;
  const std::size_t count = numbers.next<std::uint8_t>() % kMaxBlocks;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3i at(numbers.next<std::int32_t>(), numbers.next<std::int32_t>(), numbers.next<std::int32_t>());
    auto block = std::make_shared<DistanceField::Block>();
    block->fill(std::numeric_limits<float>::quiet_NaN());
    for (int n = numbers.next<std::uint8_t>() % 4; n >= 0; --n)
      (*block)[numbers.next<std::uint16_t>() % block->size()] = numbers.next<float>();
    blocks.push_back({at, std::move(block)});
  }
  return {voxel_size, origin, max_distance, std::move(blocks), rotation.normalized()};
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Numbers numbers(data, size);
  const auto file = fuzz::folder() / "distances.vdb";
  try {
    write_distances(file, field_of(numbers));
  } catch (const std::exception&) {
    return 0;  // no valid field
  }
  fuzz::expect_value_or_plain_error([&] {
    const DistanceField field = DistanceField::read(file);
    const Eigen::AlignedBox3f box = field.bounds();
    for (const auto& [at, samples] : field.blocks()) fuzz::touch(*samples);
    for (const Eigen::Vector3f& point : {box.min(), box.max(), Eigen::Vector3f(box.center()), vector(numbers)})
      (void)field.query(point);
  });
  return 0;
}
