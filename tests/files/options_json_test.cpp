#include "files/options_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <bit>

#include "support/refusal.h"

namespace traceflow {
namespace {

using ::testing::HasSubstr;

enum class Kind { plain, very_special };
constexpr std::array<std::string_view, 2> enum_names(Kind) { return {"plain", "very-special"}; }

struct Tone {
  float x = 0, y = 0.5F, z = 1;
};

struct Inner {
  float rate = 1e-3F;
  Tone tone;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("rate", rate, "", "");
    v.field("tone", tone, "", "");
  }
};

struct Settings {
  int64_t count = 3;
  double exact = 1e-15;
  bool on = true;
  std::string title = "a \"title\"";
  Kind kind = Kind::very_special;
  Inner inner;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("count", count, "", "");
    v.group("inner", inner);
    v.field("exact", exact, "", "");
    v.field("on", on, "", "");
    v.field("title", title, "", "");
    v.field("kind", kind, "", "");
  }
};

std::string options_refusal(const std::string& text) {
  Settings settings;
  return refusal_of([&] { options_from_json(text, option_fields(settings), "state.safetensors"); });
}

TEST(OptionsJson, KeepsOrderGroupsAndShortNumbers) {
  EXPECT_EQ(options_to_json(Settings{}),
            R"({"count":3,"inner":{"rate":0.001,"tone":[0.0,0.5,1.0]},"exact":1e-15,"on":true,)"
            R"("title":"a \"title\"","kind":"very-special"})");
}

TEST(OptionsJson, ReadsWhatIsNamedAndLeavesTheRest) {
  Settings settings;
  options_from_json(R"({"inner":{"rate":2},"kind":"plain"})", option_fields(settings), "test");
  EXPECT_EQ(settings.inner.rate, 2);
  EXPECT_EQ(settings.kind, Kind::plain);
  EXPECT_EQ(settings.count, 3);
}

TEST(OptionsJson, RefusalsNameFilePathAndValue) {
  EXPECT_EQ(options_refusal(R"({"inner":{"rate":"fast"}})"),
            "state.safetensors: inner.rate: found fast, expected a number");
  EXPECT_EQ(options_refusal(R"({"on":null})"), "state.safetensors: on: found null, expected true or false");
  EXPECT_THAT(options_refusal(R"({"inner":{"rates":1}})"), HasSubstr("did you mean inner.rate?"));
  EXPECT_THAT(options_refusal(R"({"inner":1})"), HasSubstr("a group of options"));
  EXPECT_THAT(options_refusal(R"({"count":18446744073709551615})"), HasSubstr("found 18446744073709551615"));
  EXPECT_THAT(options_refusal(R"({"inner":{"tone":[1,"a",2]}})"), HasSubstr("three numbers"));
  EXPECT_THAT(options_refusal("[1]"), HasSubstr("no object"));
  EXPECT_THAT(options_refusal("{"), HasSubstr("not JSON"));
  EXPECT_THAT(options_refusal(std::string(1'000'000, '[')), HasSubstr("nested too deep"));
  EXPECT_THAT(options_refusal("[" + std::string(10'000, ',')), HasSubstr("found 10002 values"));
}

RC_GTEST_PROP(OptionsJsonProperty, EveryValueSurvives,
              (int64_t count, bool on, uint32_t rate_bits, uint64_t exact_bits)) {
  const auto title = *rc::gen::container<std::string>(rc::gen::inRange<char>(0, 127));
  Settings from;
  from.count = count;
  from.on = on;
  from.title = title;
  from.inner.rate = std::bit_cast<float>(rate_bits);
  from.exact = std::bit_cast<double>(exact_bits);
  RC_PRE(std::isfinite(from.inner.rate) && std::isfinite(from.exact));
  RC_PRE(
      std::all_of(title.begin(), title.end(), [](char c) { return static_cast<unsigned char>(c) < 0x80; }));
  Settings to;
  options_from_json(options_to_json(from), option_fields(to), "test");
  RC_ASSERT(to.count == count);
  RC_ASSERT(to.on == on);
  RC_ASSERT(to.title == title);
  RC_ASSERT(std::bit_cast<uint32_t>(to.inner.rate) == rate_bits);
  RC_ASSERT(std::bit_cast<uint64_t>(to.exact) == exact_bits);
}

}  // namespace
}  // namespace traceflow
