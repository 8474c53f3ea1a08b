#include "eval/csv_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temp_dir.h"

namespace loopd::eval {
namespace {

using loopd::testing::TempDir;
using ::testing::HasSubstr;

/// The error of opening and reading all of a file with `bytes`; empty if there is none.
std::string error_of(const std::string& bytes) {
  const TempDir dir;
  auto csv = CsvReader::open(dir.write("t.csv", bytes));
  if (!csv.ok()) return csv.error().message;
  while (true) {
    const auto some = csv->next();
    if (!some.ok()) return some.error().message;
    if (!some.value()) return "";
  }
}

TEST(CsvReader, ReadsQuotesCrlfByteOrderMarkAndBlankLines) {
  const TempDir dir;
  auto csv = CsvReader::open(
      dir.write("t.csv", "\xef\xbb\xbfquery,file\r\n\r\n1,\"a,\"\"b\"\"\"\r\n2,\n3,\"\""));
  ASSERT_TRUE(csv.ok());
  const std::size_t file = csv->column("file").value();
  ASSERT_TRUE(csv->next().value());
  EXPECT_EQ(csv->text(file), "a,\"b\"");
  EXPECT_EQ(csv->line(), 3U);
  ASSERT_TRUE(csv->next().value());
  EXPECT_EQ(csv->text(file), "");
  ASSERT_TRUE(csv->next().value());
  EXPECT_EQ(csv->integer(csv->column("query").value(), 0, 9).value(), 3);
  EXPECT_FALSE(csv->next().value());
}

TEST(CsvReader, EveryErrorNamesFileAndLine) {
  EXPECT_THAT(error_of(""), HasSubstr("t.csv is empty"));
  EXPECT_THAT(error_of("\n\n"), HasSubstr("t.csv is empty"));
  EXPECT_THAT(error_of("a,,b\n"), HasSubstr("t.csv:1: column 2"));
  EXPECT_THAT(error_of("a,b,a\n"), HasSubstr("t.csv:1: column \"a\" is in the header twice"));
  EXPECT_THAT(error_of("a,b\n1\n"), HasSubstr("t.csv:2: the row has 1 fields, the header has 2"));
  EXPECT_THAT(error_of("a,b\n1,2\n1,2,3\n"), HasSubstr("t.csv:3: the row has 3 fields"));
  EXPECT_THAT(error_of("a,b\n1,\"2\n"), HasSubstr("t.csv:2: a quoted field does not end"));
  EXPECT_THAT(error_of("a,b\n\"1\"x,2\n"), HasSubstr("t.csv:2: text follows"));
  EXPECT_THAT(error_of("a\n" + std::string(1 << 20, 'x')),
              HasSubstr("t.csv:2: the line is longer"));
  EXPECT_EQ(error_of("a,b\n1,2\n"), "");
}

TEST(CsvReader, MissingFileAndFolderAreErrors) {
  const TempDir dir;
  EXPECT_THAT(CsvReader::open(dir / "none.csv").error().message, HasSubstr("none.csv"));
  EXPECT_THAT(CsvReader::open(dir.path()).error().message, HasSubstr("it is a folder"));
}

TEST(CsvReader, NumbersAreCheckedAndBadTextIsMadeHarmless) {
  const TempDir dir;
  auto csv =
      CsvReader::open(dir.write("t.csv", "n\n12x\n-1\n99999999999999999999\nnan\n\x1b[31m\n"));
  ASSERT_TRUE(csv.ok());
  const std::size_t n = csv->column("n").value();
  EXPECT_THAT(csv->column("m").error().message, HasSubstr("no column \"m\""));
  for (const char* shown :
       {"\"12x\"", "\"-1\"", "\"99999999999999999999\"", "\"nan\"", "\"?[31m\""}) {
    ASSERT_TRUE(csv->next().value());
    const auto value = csv->integer(n, 0, 100);
    ASSERT_FALSE(value.ok());
    EXPECT_THAT(value.error().message, HasSubstr("column n: " + std::string(shown)));
  }
}

TEST(CsvReader, RealRefusesWhatIsNotFinite) {
  const TempDir dir;
  auto csv = CsvReader::open(dir.write("t.csv", "v\n1.5e3\nnan\ninf\n1e999\n0x10\n1.0 \n"));
  ASSERT_TRUE(csv.ok());
  ASSERT_TRUE(csv->next().value());
  EXPECT_EQ(csv->real(0).value(), 1500);
  while (csv->next().value()) EXPECT_FALSE(csv->real(0).ok()) << csv->text(0);
}

}  // namespace
}  // namespace loopd::eval
