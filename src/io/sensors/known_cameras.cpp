// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/io/known_cameras.hpp"

#include <algorithm>
#include <array>

#include "io/sensors/kinect.hpp"

namespace cairn {
namespace {

constexpr double kTum = 5000, kMillimeters = 1000;
constexpr Lens kBrown = Lens::brown_conrady;

// Freiburg cameras: Sturm et al. 2012. Bonn: Palazzolo et al. 2019. 7-Scenes: Shotton et al. 2013. ICL-NUIM: Handa et
// al. 2014, with fy made positive. For a Kinect with depth registered to color, the readout is the color camera's,
// confirmed by `cairn calibrate --shutter`. Kinects: uncalibrated defaults of OpenNI and Open3D. Azure Kinect: factory
// calibration of a single device.
constexpr std::array kCameras{
    KnownCamera{"freiburg1",
                "TUM RGB-D's freiburg1",
                kTum,
                {640,
                 480,
                 517.3,
                 516.5,
                 318.6,
                 255.3,
                 {0.2624, -0.9531, -0.0054, 0.0026, 1.1633},
                 kBrown,
                 kKinectColorReadout}},
    KnownCamera{"freiburg2",
                "TUM RGB-D's freiburg2",
                kTum,
                {640,
                 480,
                 520.9,
                 521.0,
                 325.1,
                 249.7,
                 {0.2312, -0.7849, -0.0033, -0.0001, 0.9172},
                 kBrown,
                 kKinectColorReadout}},
    KnownCamera{"freiburg3", "TUM RGB-D's freiburg3", kTum, {640, 480, 535.4, 539.2, 320.1, 247.6, {}}},
    KnownCamera{
        "bonn",
        "the Bonn dynamic dataset's",
        kTum,
        {640, 480, 542.822841, 542.576870, 315.593520, 237.756098, {0.039903, -0.099343, -0.000730, -0.000144}}},
    KnownCamera{"icl-nuim", "ICL-NUIM's", kTum, {640, 480, 481.2, 480, 319.5, 239.5, {}}},
    KnownCamera{"seven-scenes",
                "7-Scenes' depth camera",
                kMillimeters,
                {640, 480, 585, 585, 320, 240, {}, kBrown, kKinectDepthReadout}},
    KnownCamera{"kinect-v1",
                "Kinect for Xbox 360, Xtion or PrimeSense, depth registered to color",
                0,
                {640, 480, 525, 525, 319.5, 239.5, {}}},
    KnownCamera{
        "kinect-v2", "Kinect for Xbox One, its depth camera", 0, {512, 424, 365.456, 365.456, 254.878, 205.395, {}}},
    KnownCamera{"azure-kinect",
                "Azure Kinect, its depth camera in the narrow mode",
                0,
                {640,
                 576,
                 504.6,
                 504.7,
                 332.8,
                 348.8,
                 {0.54794, -0.020971, 2.0558e-5, -7.2104e-5, -0.0026522, 0.88968, 0.08613, -0.01391}}},
    KnownCamera{"azure-kinect-color",
                "Azure Kinect, depth registered to color of 1280x720",
                0,
                {1280,
                 720,
                 611.8,
                 611.9,
                 639.3,
                 365.9,
                 {0.33012, -2.4894, -1.6178e-4, -1.2945e-4, 1.45367, 0.20891, -2.3029, 1.37513}}}};

}  // namespace

std::span<const KnownCamera> known_cameras() { return kCameras; }

const KnownCamera* known_camera(std::string_view name) {
  if (name == "azure-kinect-colour") name = "azure-kinect-color";  // the name before version 0.2
  const auto* const found =
      std::find_if(kCameras.begin(), kCameras.end(), [&](const KnownCamera& c) { return c.name == name; });
  return found == kCameras.end() ? nullptr : found;
}

}  // namespace cairn
