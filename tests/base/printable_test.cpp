#include "base/printable.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace traceflow {
namespace {

TEST(Printable, LeavesTextOfAnyAlphabet) {
  for (const char* text : {"", "points.npy", "3×4 …", "видео/кадр", "写真", "🫖"})
    EXPECT_EQ(printable(text, 100), text);
}

TEST(Printable, ShowsAQuestionMarkForWhatATerminalWouldObey) {
  EXPECT_EQ(printable("a\x1b[2Jb\r\n\t\x7f", 100), "a?[2Jb????");
  EXPECT_EQ(printable(std::string_view("a\0b", 3), 100), "a?b");
  EXPECT_EQ(printable("\xc2\x9b"
                      "2J",
                      100),
            "??2J");  // U+009B, the other way to write ESC [
  EXPECT_EQ(printable("a\xe2\x80\xae"
                      "b",
                      100),
            "a???b");  // U+202E, from here to the left
}

TEST(Printable, ShowsAQuestionMarkForBytesThatAreNoCharacter) {
  EXPECT_EQ(printable("\xff\xfe{}", 100), "??{}");
  EXPECT_EQ(printable("\xc3", 100), "?");
  EXPECT_EQ(printable("\xc0\xaf", 100), "??");            // a slash in more bytes than it needs
  EXPECT_EQ(printable("\xed\xa0\x80", 100), "???");       // half a pair of UTF-16
  EXPECT_EQ(printable("\xf4\x90\x80\x80", 100), "????");  // beyond the last character
  EXPECT_EQ(printable("\xe2\x82x", 100), "??x");
}

TEST(Printable, CutsBetweenCharacters) {
  EXPECT_EQ(printable("abcd", 4), "abcd");
  EXPECT_EQ(printable("abcde", 4), "abcd…");
  EXPECT_EQ(printable("abc×", 4), "abc…");
}

TEST(InputError, IsOneShortLineWhateverWasFound) {
  const InputError error("file", "a\nb", std::string(100000, '\x1b'), "c\rd", "");
  const std::string text = error.what();
  EXPECT_TRUE(text.starts_with("file: a?b: found ????"));
  EXPECT_TRUE(text.ends_with("…, expected c?d"));
  EXPECT_LT(text.size(), 500U);
}

}  // namespace
}  // namespace traceflow
