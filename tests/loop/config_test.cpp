#include "loopd/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <limits>
#include <set>

#include "loopd/report.h"

namespace loopd {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Stands for a value of any field.
struct AnyValue {
  template <class T>
  operator T() const;
};

template <class T, std::size_t... I>
constexpr bool takes(std::index_sequence<I...>) {
  return requires { T{(static_cast<void>(I), AnyValue{})...}; };
}

/// How many fields an aggregate has: the most values that may initialise it.
template <class T, std::size_t N = 64>
constexpr std::size_t fields_of() {
  if constexpr (takes<T>(std::make_index_sequence<N>{}))
    return N;
  else
    return fields_of<T, N - 1>();
}

const void* address_of(const ParameterRef& ref) {
  return std::visit([](auto* value) -> const void* { return value; }, ref);
}

template <class Section>
bool is_inside(const Section& section, const void* address) {
  const auto* first = reinterpret_cast<const std::byte*>(&section);
  const auto* at = static_cast<const std::byte*>(address);
  return at >= first && at < first + sizeof section;
}

bool key_names_section(const Config& config, std::string_view key, const void* address) {
  if (key.starts_with("features.")) return is_inside(config.features, address);
  if (key.starts_with("index.")) return is_inside(config.index, address);
  if (key.starts_with("loop.")) return is_inside(config.loop, address);
  return key.starts_with("verify.") && is_inside(config.verify, address);
}

TEST(Parameters, HoldEveryFieldOfEverySectionOnce) {
  EXPECT_EQ(fields_of<Config>(), 5u);  // the sections, and the budget, which is no parameter
  EXPECT_EQ(parameters().size(), fields_of<FeaturesConfig>() + fields_of<IndexConfig>() +
                                     fields_of<LoopConfig>() + fields_of<VerifyConfig>());
  Config config;
  std::set<const void*> fields;
  for (const auto& parameter : parameters()) {
    const void* address = address_of(parameter.ref(config));
    EXPECT_TRUE(fields.insert(address).second) << parameter.key << ": its field is there twice";
    EXPECT_TRUE(key_names_section(config, parameter.key, address)) << parameter.key;
  }
}

TEST(Parameters, HaveUniqueKeysARangeAndAReason) {
  std::set<std::string_view> keys;
  for (const auto& parameter : parameters()) {
    EXPECT_TRUE(keys.insert(parameter.key).second) << parameter.key;
    EXPECT_LT(parameter.min, parameter.max) << parameter.key;
    EXPECT_GT(parameter.reason.size(), 10u) << parameter.key;
  }
}

TEST(Parameters, DefaultsAreInTheirRanges) { EXPECT_THAT(validate(Config{}), IsEmpty()); }

TEST(Parameters, CandidateListsFitIntoAReport) {
  for (const auto& parameter : parameters())
    if (parameter.key == "loop.max_candidates") {
      EXPECT_EQ(parameter.max, Report::kMaxCandidates);
    }
}

void set(const ParameterRef& ref, double value) {
  if (auto* const* number = std::get_if<int*>(&ref)) **number = static_cast<int>(value);
  if (auto* const* number = std::get_if<double*>(&ref)) **number = value;
}

TEST(Validate, AcceptsBothBoundsOfEveryParameter) {
  for (const auto& parameter : parameters()) {
    Config config;
    set(parameter.ref(config), parameter.min);
    EXPECT_THAT(validate(config), IsEmpty());
    set(parameter.ref(config), parameter.max);
    EXPECT_THAT(validate(config), IsEmpty());
  }
}

TEST(Validate, RefusesWhatIsBeyondEitherBoundOfEveryParameter) {
  for (const auto& parameter : parameters()) {
    Config config;
    if (std::holds_alternative<bool*>(parameter.ref(config))) continue;  // has no value beyond
    for (const double beyond : {parameter.min - 1, parameter.max + 1}) {
      set(parameter.ref(config), beyond);
      EXPECT_THAT(validate(config), ElementsAre(HasSubstr(parameter.key)));
    }
  }
}

TEST(Validate, NamesKeyValueAndConstraint) {
  Config config;
  config.verify.min_inliers = 3;
  config.loop.still_fraction = 1.5;
  EXPECT_THAT(
      validate(config),
      ElementsAre("loop.still_fraction = 1.5. Violated constraint: loop.still_fraction <= 1",
                  "verify.min_inliers = 3. Violated constraint: verify.min_inliers >= 8"));
}

TEST(Validate, ListsAllOfTenMistakes) {
  Config config;
  config.features.points = -1;
  config.features.scale_factor = 1.0;
  config.features.levels = 13;
  config.index.word_ratio = 1.01;
  config.index.probation_images = std::numeric_limits<int>::min();
  config.loop.waiting_frames = 0;
  config.loop.waiting_s = -0.5;
  config.loop.max_candidates = 65;
  config.verify.epipolar_px = std::numeric_limits<double>::infinity();
  config.verify.seed = -7;
  const auto violations = validate(config);
  EXPECT_EQ(violations.size(), 10u);
  for (const char* key :
       {"features.points = -1", "features.scale_factor = 1", "features.levels = 13",
        "index.word_ratio = 1.01", "index.probation_images = -2147483648",
        "loop.waiting_frames = 0", "loop.waiting_s = -0.5", "loop.max_candidates = 65",
        "verify.epipolar_px = inf", "verify.seed = -7"})
    EXPECT_THAT(violations, Contains(AllOf(HasSubstr(key), HasSubstr("Violated constraint: "))));
}

TEST(Validate, RefusesNaNInEveryParameter) {
  for (const auto& parameter : parameters()) {
    Config config;
    const ParameterRef ref = parameter.ref(config);
    if (!std::holds_alternative<double*>(ref)) continue;
    set(ref, std::numeric_limits<double>::quiet_NaN());
    EXPECT_THAT(validate(config), ElementsAre(HasSubstr(parameter.key)));
  }
}

TEST(Validate, WantsPointsOrLines) {
  Config config;
  config.features.points = 0;
  EXPECT_THAT(validate(config), IsEmpty());
  config.features.lines = 0;
  EXPECT_THAT(validate(config), ElementsAre(AllOf(HasSubstr("features.points = 0"),
                                                  HasSubstr("features.lines = 0"))));
  config.features.points = 1;
  EXPECT_THAT(validate(config), IsEmpty());
}

}  // namespace
}  // namespace loopd
