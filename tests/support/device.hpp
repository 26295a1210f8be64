// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "gpu/device.hpp"

namespace cairn {

/// Device shared by all tests of a program, with the validation layer on. Any message of the layer fails the current
/// test.
gpu::Device& test_device();

}  // namespace cairn
