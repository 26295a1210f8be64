// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/device.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>

namespace cairn {
namespace {

std::unique_ptr<gpu::Device> device;

class ValidationIsSilent : public testing::EmptyTestEventListener {
  std::size_t seen_ = 0;
  void OnTestEnd(const testing::TestInfo&) override {
    if (!device) return;
    const auto& messages = device->validation_messages();
    for (; seen_ < messages.size(); ++seen_) ADD_FAILURE() << "validation layer: " << messages[seen_];
  }
};

class DeviceEnvironment : public testing::Environment {
  void SetUp() override { testing::UnitTest::GetInstance()->listeners().Append(new ValidationIsSilent); }
  void TearDown() override { device.reset(); }
};

[[maybe_unused]] const auto* const kEnvironment = testing::AddGlobalTestEnvironment(new DeviceEnvironment);

}  // namespace

gpu::Device& test_device() {
  if (!device) {
    setenv("CAIRN_VALIDATION", "1", 0);  // unless set by the caller
    device = std::make_unique<gpu::Device>();
  }
  return *device;
}

}  // namespace cairn
