#include "base/utf8.h"

#include <gtest/gtest.h>
#include <iconv.h>

#include <string>

namespace traceflow {
namespace {

// The oracle: the C library's converter.
class Utf8 : public testing::Test {
 protected:
  ~Utf8() override { iconv_close(converter_); }

  std::string encoded(char32_t code) const {
    std::string text(8, '\0');
    char *from = reinterpret_cast<char*>(&code), *to = text.data();
    size_t from_bytes = sizeof(code), left = text.size();
    EXPECT_EQ(iconv(converter_, &from, &from_bytes, &to, &left), 0U);
    text.resize(text.size() - left);
    return text;
  }

 private:
  iconv_t converter_ = iconv_open("UTF-8", "UTF-32LE");
};

TEST_F(Utf8, ReadsEveryCharacter) {
  for (char32_t code = 0; code <= 0x10ffff; ++code) {
    if (code >= 0xd800 && code <= 0xdfff) continue;
    const std::string text = encoded(code);
    const auto found = first_utf8_character(text + "a");
    ASSERT_TRUE(found) << static_cast<uint32_t>(code);
    ASSERT_EQ(found->code, code);
    ASSERT_EQ(found->bytes, text.size());
  }
}

TEST_F(Utf8, RefusesWhatIsNoCharacter) {
  for (const std::string text : {"\x80", "\xc3", "\xc3z", "\xe2\x80", "\xc1\x81", "\xe0\x81\x81",
                                 "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xf8\x88\x80\x80\x80", "\xff"})
    EXPECT_FALSE(first_utf8_character(text)) << text;
}

TEST_F(Utf8, OtherBytesAreWrittenAsNumbers) {
  EXPECT_EQ(as_utf8("caf\xe9 \xff.mp4"), "caf%E9 %FF.mp4");
  EXPECT_EQ(as_utf8("caf\xc3\xa9"), "caf\xc3\xa9");
  EXPECT_EQ(as_utf8(""), "");
}

}  // namespace
}  // namespace traceflow
