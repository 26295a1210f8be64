// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/datasets/image_names.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Unit = Numbering::Unit;
using By = Pairs::By;
using Names = std::vector<fs::path>;

std::optional<Pairs> pairs_of(const Names& depth, const Names& color) {
  return pair_images(depth, numbering_of(depth), color, numbering_of(color));
}

TEST(NaturalOrder, SortsNumbersByValue) {
  std::vector<std::string> names{"b1", "a10", "a9", "a 2", "a1", "a01", "a1b", "a", "img12_3", "img2_20", "Z1"};
  std::sort(names.begin(), names.end(), natural_less);
  EXPECT_EQ(names,
            (std::vector<std::string>{"Z1", "a", "a 2", "a01", "a1", "a1b", "a9", "a10", "b1", "img2_20", "img12_3"}));
  EXPECT_TRUE(natural_less("99999999999999999999999", "100000000000000000000000"));  // exceeds integer types
  for (const char* name : {"", "1", "01", "a1"}) EXPECT_FALSE(natural_less(name, name));
}

TEST(ImagesIn, ListsImagesInNaturalOrder) {
  const TemporaryFolder folder;
  for (const char* name :
       {"10.png", "9.PNG", "._9.png", ".hidden.png", "Thumbs.db", "notes.txt", "3 \xc3\xa4.JPG", "20.jpeg", "5.tiff"})
    write_text(folder / name, "");
  fs::create_directories(folder / "11.png");
  const auto names = [](const Names& files) {
    std::vector<std::string> all;
    for (const auto& file : files) all.push_back(file.filename().string());
    return all;
  };
  EXPECT_EQ(names(images_in(folder.path())),
            (std::vector<std::string>{"3 \xc3\xa4.JPG", "5.tiff", "9.PNG", "10.png", "20.jpeg"}));
  EXPECT_EQ(names(depth_images_in(folder.path())), (std::vector<std::string>{"5.tiff", "9.PNG", "10.png"}));
  write_text(folder / "10.npy", "");
  EXPECT_EQ(names(depth_images_in(folder.path())), (std::vector<std::string>{"5.tiff", "9.PNG", "10.npy"}));
  EXPECT_TRUE(images_in(folder / "nowhere").empty());
}

TEST(Numbering, DetectsTimeUnitByStep) {
  const auto unit = [](const Names& names) { return numbering_of(names).unit; };
  EXPECT_EQ(unit({"1305031102.175304.png", "1305031102.211214.png", "1305031103.043129.png"}), Unit::seconds);
  EXPECT_EQ(unit({"0.0.png", "0.033333.png", "0.066667.png"}), Unit::seconds);
  EXPECT_EQ(unit({"depth_1700000000123.png", "depth_1700000000156.png"}), Unit::milliseconds);
  EXPECT_EQ(unit({"0.png", "33.png", "67.png", "100.png"}), Unit::milliseconds);
  EXPECT_EQ(unit({"1700000000123456.png", "1700000000156789.png"}), Unit::microseconds);
  EXPECT_EQ(unit({"0.png", "33333.png", "66667.png"}), Unit::microseconds);
  EXPECT_EQ(unit({"1700000000123456789.png", "1700000000156789123.png"}), Unit::nanoseconds);
  EXPECT_EQ(unit({"5000000000.png", "5033333333.png", "5066666666.png"}), Unit::nanoseconds);
  EXPECT_EQ(unit({"1700000000123.png"}), Unit::milliseconds);
  EXPECT_EQ(unit({"0.png", "1.png", "2.png", "5.png"}), Unit::frames);
  EXPECT_EQ(unit({"0.png", "5.png", "10.png", "20.png"}), Unit::frames);      // every fifth frame
  EXPECT_EQ(unit({"000000.png", "000030.png", "000061.png"}), Unit::frames);  // zero-padded
  EXPECT_EQ(unit({"scan1.0001.png", "scan1.0002.png", "scan1.0003.png"}), Unit::frames);
  EXPECT_EQ(unit({"a.png", "b.png"}), Unit::none);
  EXPECT_EQ(unit({"2024-05-01-12-33-07.png", "2024-05-01-12-34-08.png"}), Unit::none);  // a date
  EXPECT_EQ(unit({"123456789012345678901234.png", "123456789012345678901235.png"}), Unit::none);
  EXPECT_EQ(unit({}), Unit::none);
}

TEST(Numbering, KeepsDifferencesOfSeconds) {
  const auto numbering = numbering_of(Names{"1700000000123456789.png", "1700000000156789123.png"});
  EXPECT_NEAR(numbering.values[1] - numbering.values[0], 0.033332334, 1e-6);
  EXPECT_NEAR(numbering.values[0], 1700000000.123456789, 1e-6);
  EXPECT_NEAR(numbering_of(Names{"0.png", "33.png", "67.png"}).step, 0.034, 1e-9);
}

TEST(Pairs, AreFoundByEqualNames) {
  const auto pairs = pairs_of({"d/a.png", "d/b.png", "d/c.png"}, {"c/A.JPG", "c/c.jpg", "c/x.jpg"});
  ASSERT_TRUE(pairs);
  EXPECT_EQ(pairs->by, By::name);
  EXPECT_EQ(pairs->color, (std::vector<int>{0, -1, 1}));
  EXPECT_EQ(pairs->alone, 1);
  EXPECT_EQ(pairs->color_alone, 1);
}

TEST(Pairs, AreFoundByEqualNumbers) {
  struct Case {
    Names depth, color;
  };
  for (const auto& [depth, color] :
       {Case{{"frame-000012.depth.png", "frame-000013.depth.png", "frame-000015.depth.png"},
             {"frame-000012.color.jpg", "frame-000014.color.jpg", "frame-000015.color.jpg"}},
        Case{{"depth_9.png", "depth_10.png", "depth_11.png"}, {"rgb_0009.jpg", "rgb_0012.jpg", "rgb_0011.jpg"}},
        Case{{"12_depth.png", "13_depth.png", "15_depth.png"}, {"12.png", "14.png", "15.png"}},
        Case{{"cam0_depth16_1.png", "cam0_depth16_2.png", "cam0_depth16_3.png"},
             {"cam1_rgb8_1.png", "cam1_rgb8_7.png", "cam1_rgb8_3.png"}},
        Case{{"s1_5_depth.png", "s2_5_depth.png", "s2_6_depth.png"},
             {"s1_5_rgb.png", "s1_6_rgb.png", "s2_6_rgb.png"}}}) {
    const auto pairs = pairs_of(depth, color);
    ASSERT_TRUE(pairs) << depth[0];
    EXPECT_EQ(pairs->by, By::number) << depth[0];
    EXPECT_EQ(pairs->color, (std::vector<int>{0, -1, 2})) << depth[0];
  }
  const auto one = pairs_of({"depth_12.png"}, {"rgb_11.png", "rgb_12.png", "rgb_13.png"});
  EXPECT_EQ(one->color, std::vector<int>{1});
}

TEST(Pairs, OfTimesAreNearestWithinHalfAFrame) {
  // 30 Hz each; color is 4 ms later and lacks its third image.
  const auto pairs = pairs_of({"0.png", "33.png", "67.png", "100.png"}, {"4.jpg", "37.jpg", "104.jpg"});
  ASSERT_TRUE(pairs);
  EXPECT_EQ(pairs->by, By::time);
  EXPECT_EQ(pairs->color, (std::vector<int>{0, 1, -1, 2}));
  // Two units of the same clock; some numbers agree by chance.
  const auto mixed = pairs_of({"1700000000.000000.png", "1700000000.033333.png", "1700000000.066667.png"},
                              {"1700000000001000000.png", "1700000000034000000.png", "1700000000068000000.png"});
  EXPECT_EQ(mixed->by, By::time);
  EXPECT_EQ(mixed->color, (std::vector<int>{0, 1, 2}));
}

TEST(Pairs, FallBackToOrder) {
  const auto pairs = pairs_of({"a.png", "b.png"}, {"x.png", "y.png"});
  ASSERT_TRUE(pairs);
  EXPECT_EQ(pairs->by, By::order);
  EXPECT_EQ(pairs->color, (std::vector<int>{0, 1}));
  EXPECT_FALSE(pairs_of({"a.png", "b.png"}, {"x.png", "y.png", "z.png"}));
  EXPECT_EQ(pairs_of({"a.png"}, {})->by, By::nothing);
}

TEST(Associate, MatchesClosestPairsOneToOne) {
  EXPECT_EQ(associate(std::vector{0.0, 0.1, 0.2}, std::vector{0.19, 0.11}, 0.1), (std::vector<int>{-1, 1, 0}));
  const std::vector<double> same(1001, 5.0);
  EXPECT_NE(error_of([&] { (void)associate(std::vector{5.0}, same, 0.1); }).find("more than 1000 images"),
            std::string::npos);
}

}  // namespace
}  // namespace cairn
