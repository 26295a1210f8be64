// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <string>

#include "cairn/mapping/frame.hpp"

namespace cairn {

/// Removes the measurements of masked pixels from each frame: their depth becomes 0 and their color, if registered to
/// depth, gets alpha 0, which keeps it out of textures. A mask is an image whose nonzero pixels are ignored (of several
/// channels any but alpha), of the size of the depth images, or of the color images of a separate color camera. Its
/// name ends with the number of the depth image, in a recording without numbered depth images with Frame::index
/// (000012.png), or with the time of the depth or color image in seconds (12.345678.png). Frames without a mask stay
/// unchanged; a warning at the end counts them. `recording`: name given to open_source. Throws std::runtime_error for
/// a folder without masks, and for a first mask that is unreadable or of another size; a later one sets
/// Frame::problem.
[[nodiscard]] std::unique_ptr<Source> with_masks(std::unique_ptr<Source> source, const std::filesystem::path& folder,
                                                 const std::string& recording = {});

}  // namespace cairn
