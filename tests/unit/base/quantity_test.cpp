// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/quantity.hpp"

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(Quantity, ConvertsEveryUnit) {
  for (const char* text :
       {"0.02", "2cm", "20mm", "0.02m", "20 mm", "2e-2", "+0.02", " .02 ", "0.2dm", "20000um", "2e1mm"})
    EXPECT_EQ(parse_quantity(text, Unit::meters), 0.02) << text;
  for (const char* text : {"0.5", "500ms", "0.5s", "5e2ms"})
    EXPECT_EQ(parse_quantity(text, Unit::seconds), 0.5) << text;
  EXPECT_EQ(parse_quantity("2min", Unit::seconds), 120);
  EXPECT_EQ(parse_quantity("300cm2", Unit::square_meters), 0.03);
  EXPECT_EQ(parse_quantity("50%", Unit::share), 0.5);
  EXPECT_EQ(parse_quantity("180deg", Unit::radians), 3.141592653589793);
  EXPECT_EQ(parse_quantity("512", Unit::mebibytes), 512);
  EXPECT_EQ(parse_quantity("2GiB", Unit::mebibytes), 2048);
  EXPECT_EQ(parse_quantity("1MiB", Unit::bytes), 1048576);
  EXPECT_EQ(parse_quantity("-3.5"), -3.5);
}

TEST(Quantity, IsExactAtTypedBounds) {
  const AllowedRange range{0.002, 0.2};
  for (const char* text : {"0.2", "20cm", "200mm", "0.002", "2mm", "0.2cm"})
    EXPECT_TRUE(range.has(*parse_quantity(text, Unit::meters))) << text;
  for (const char* text : {"0.2000000001", "20.00001cm", "0.0019999999", "1.999mm"})
    EXPECT_FALSE(range.has(*parse_quantity(text, Unit::meters))) << text;
  EXPECT_TRUE(range.has(0.2f));  // rounded to a float, which is more than 0.2
  EXPECT_FALSE(range.has(0.2001f));
}

TEST(Quantity, IsFinite) {
  for (const char* text : {"nan",    "inf",   "-inf", "infinity", "NaN",  "nan(1)", "1e999",
                           "-1e999", "1e",    "",     " ",        "-",    ".",      "0x10",
                           "1,5",    "2 c m", "2cms", "2kg",      "2cm3", "two",    "1e99999999999999999999",
                           "--1",    "+-1"})
    EXPECT_FALSE(parse_quantity(text, Unit::meters)) << text;
  EXPECT_FALSE(parse_quantity("2cm", Unit::seconds));
  EXPECT_FALSE(parse_quantity("2s", Unit::meters));
  const AllowedRange any;
  for (const double value : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    EXPECT_FALSE(any.has(value));
    EXPECT_FALSE(any.has(static_cast<float>(value)));
  }
}

TEST(Quantity, ParsesDecimalIntegersOnly) {
  EXPECT_EQ(parse_whole("010"), 10);
  EXPECT_EQ(parse_whole("-1"), -1);
  EXPECT_EQ(parse_whole("9007199254740993"), 9007199254740993);
  for (const char* text : {"1.5", "1e3", "0x10", "", "nan", "99999999999999999999", "5cm"})
    EXPECT_FALSE(parse_whole(text)) << text;
}

TEST(Quantity, DescribesRange) {
  EXPECT_EQ(words_of({0.002, 0.2}, Unit::meters), "0.002 to 0.2 m");
  EXPECT_EQ(words_of({.min = 0, .max = 10, .is_open = true}, Unit::meters), "more than 0, at most 10 m");
  EXPECT_EQ(words_of({.min = 0}), "0 or more");
  EXPECT_EQ(words_of({100, 4e9}), "100 to 4000000000");
}

}  // namespace
}  // namespace cairn
