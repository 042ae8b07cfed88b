#include "base/option_fields.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <bit>

#include "support/refusal.h"

namespace traceflow {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

enum class Shape3 { ball, flat_disk };
constexpr std::array<std::string_view, 2> enum_names(Shape3) { return {"ball", "flat-disk"}; }

struct Colour {
  float x = 0, y = 0, z = 0;
};

struct Inner {
  float rate = 1e-3F;
  bool on = true;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("rate", rate, "per step", "How fast.");
    v.field("on", on, "", "Whether.");
  }
};

struct Outer {
  int count = 3;
  int64_t seed = 1;
  double precise = 0.1;
  std::string title = "plain";
  Shape3 shape = Shape3::ball;
  Colour colour;
  Inner inner;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("count", count, "items", "How many.");
    v.field("seed", seed, "", "Seed.");
    v.field("precise", precise, "m", "Exact.");
    v.field("title", title, "", "Name.");
    v.field("shape", shape, "", "Which.");
    v.field("colour", colour, "", "Tone.");
    v.group("inner", inner);
  }
};

TEST(OptionFields, ListsEveryFieldWithItsPathAndText) {
  Outer options;
  std::vector<std::string> lines;
  for (const OptionField& f : option_fields(options)) lines.push_back(f.path + " = " + option_text(f.get()));
  EXPECT_THAT(lines, ElementsAre("count = 3", "seed = 1", "precise = 0.1", "title = plain", "shape = ball",
                                 "colour = 0,0,0", "inner.rate = 0.001", "inner.on = true"));
  EXPECT_EQ(option_fields(options, "all.")[6].path, "all.inner.rate");
}

TEST(OptionFields, AssignmentsOfEveryKindReachTheStruct) {
  Outer options;
  const auto fields = option_fields(options);
  for (const char* assignment : {"count=-7", "seed=9223372036854775807", "precise=1e-300", "title=a=b,c",
                                 "shape=flat_disk", "colour=1,0.5,-2", "inner.rate=2.5", "inner.on=off"}) {
    set_option_assignment(fields, assignment, "--set");
  }
  EXPECT_EQ(options.count, -7);
  EXPECT_EQ(options.seed, INT64_MAX);
  EXPECT_EQ(options.precise, 1e-300);
  EXPECT_EQ(options.title, "a=b,c");
  EXPECT_EQ(options.shape, Shape3::flat_disk);
  EXPECT_EQ(options.colour.x, 1);
  EXPECT_EQ(options.colour.y, 0.5F);
  EXPECT_EQ(options.colour.z, -2);
  EXPECT_EQ(options.inner.rate, 2.5F);
  EXPECT_FALSE(options.inner.on);
}

TEST(OptionFields, RefusesWhatAFieldCannotHoldAndLeavesItAlone) {
  Outer options;
  const auto fields = option_fields(options);
  const auto message = [&](const std::string& assignment) {
    return refusal_of([&] { set_option_assignment(fields, assignment, "--set"); });
  };
  EXPECT_EQ(message("count=3.5"), "--set: count: found 3.5, expected a whole number");
  EXPECT_EQ(message("count="), "--set: count: found nothing, expected a whole number");
  EXPECT_EQ(message("shape=cube"), "--set: shape: found cube, expected ball or flat-disk");
  EXPECT_EQ(message("inner.on=maybe"), "--set: inner.on: found maybe, expected true or false");
  for (const char* assignment :
       {"count=2147483648", "count=1 2", "seed=9223372036854775808", "inner.rate=nan", "inner.rate=inf",
        "inner.rate=1e39", "precise=1e309", "precise=abc", "colour=1,2", "colour=1,2,3,4", "colour=1,,3",
        "colour=1,2,nan", "colour=1,2,1e39", "count"}) {
    EXPECT_NE(message(assignment), "accepted") << assignment;
  }
  EXPECT_EQ(options.count, 3);
  EXPECT_EQ(options.inner.rate, 1e-3F);
  EXPECT_EQ(options.colour.x, 0);
}

TEST(OptionFields, SuggestsTheNearestName) {
  Outer options;
  const auto fields = option_fields(options);
  const auto message = [&](const std::string& path) {
    return refusal_of([&] { find_option(fields, path, "--set"); });
  };
  EXPECT_THAT(message("conut"), HasSubstr("conut: found no option of this name"));
  EXPECT_THAT(message("conut"), HasSubstr("did you mean count?"));
  EXPECT_THAT(message("rate"), HasSubstr("did you mean inner.rate?"));
  EXPECT_THAT(message("iner.rat"), HasSubstr("did you mean inner.rate?"));
  EXPECT_THAT(message("inner"), HasSubstr("a group of options, expected one option, such as inner.rate"));
  EXPECT_THAT(message("something.else.entirely"), Not(HasSubstr("did you mean")));
  EXPECT_EQ(find_option(fields, "inner.rate", "").path, "inner.rate");
}

TEST(OptionFields, ValuesOfAnotherTypeAreRefused) {
  Outer options;
  const auto fields = option_fields(options);
  const std::vector<OptionValue> values{true, int64_t{1}, 1.5, std::string("ball"),
                                        std::vector<double>{1, 2, 3}};
  std::vector<std::string> taken;
  for (const OptionField& field : fields) {
    std::string row;
    for (const OptionValue& value : values) row += field.set(value) ? '1' : '0';
    taken.push_back(row);
  }
  // Columns: boolean, whole number, number, text, list.
  EXPECT_THAT(taken, ElementsAre("01000", "01000", "01100", "00010", "00010", "00001", "01100", "10000"));
}

TEST(CheckOption, ShowsSmallNumbersAsWritten) {
  EXPECT_EQ(refusal_of([] { check_option(false, "rate", 1e-9F, "more"); }),
            "option: rate: found 1e-09, expected more");
  EXPECT_EQ(refusal_of([] { check_option(false, "count", -3, "more"); }),
            "option: count: found -3, expected more");
}

RC_GTEST_PROP(OptionFieldsProperty, EveryFiniteFloatSurvivesItsText, ()) {
  const auto value = std::bit_cast<float>(*rc::gen::arbitrary<uint32_t>());
  RC_PRE(std::isfinite(value));
  Inner from;
  from.rate = value;
  Inner to;
  set_option_text(option_fields(to)[0], option_text(option_fields(from)[0].get()), "test");
  RC_ASSERT(std::bit_cast<uint32_t>(to.rate) == std::bit_cast<uint32_t>(value));
}

RC_GTEST_PROP(OptionFieldsProperty, AnyTextIsTakenOrRefusedWithItsPath, (const std::string& text)) {
  Outer options;
  const auto fields = option_fields(options);
  try {
    set_option_assignment(fields, text, "--set");
  } catch (const InputError& error) {
    RC_ASSERT(std::string_view(error.what()).starts_with("--set"));
  }
}

}  // namespace
}  // namespace traceflow
