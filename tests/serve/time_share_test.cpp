#include "serve/time_share.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace traceflow::serve {
namespace {

double tenth_of_second(int tenths) { return tenths / 10.0; }

RC_GTEST_PROP(TimeShare, PagesThatAlwaysWantMoreGetTheirShareAndNoMore, ()) {
  const double share = *rc::gen::inRange(1, 90) / 100.0;
  TimeShare account(share);
  double trained = 0, spent = 0, longest = 0;
  const auto steps = *rc::gen::nonEmpty(rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 30)));
  for (const int step : steps) {
    account.trained(tenth_of_second(step));
    trained += tenth_of_second(step);
    while (account.is_open()) {
      const double job = tenth_of_second(*rc::gen::inRange(1, 30));
      account.spent(job);
      spent += job;
      longest = std::max(longest, job);
    }
  }
  RC_ASSERT(spent <= trained * share / (1 - share) + TimeShare::most_debt + longest + 1e-9);
}

TEST(TimeShare, InTheLongRunItIsUsedWhole) {
  TimeShare account(0.25);
  double spent = 0;
  for (int i = 0; i < 10'000; ++i) {
    account.trained(0.03);
    while (account.is_open()) {
      account.spent(0.02);
      spent += 0.02;
    }
  }
  EXPECT_NEAR(spent / (spent + 300), 0.25, 0.01);
}

TEST(TimeShare, SavesUpNoMoreThanASecond) {
  TimeShare account(0.5);
  account.trained(1000);
  EXPECT_TRUE(account.allowed().refreshing);
  account.spent(TimeShare::most_credit);
  EXPECT_FALSE(account.allowed().refining);
  EXPECT_FALSE(account.allowed().refreshing);
  EXPECT_TRUE(account.is_open());
  account.spent(TimeShare::most_debt);
  EXPECT_FALSE(account.is_open());
}

TEST(TimeShare, RefiningComesBeforeRefreshing) {
  TimeShare account(0.5);
  account.trained(0.1);
  EXPECT_TRUE(account.allowed().refining);
  EXPECT_FALSE(account.allowed().refreshing);
  account.trained(0.4);
  EXPECT_TRUE(account.allowed().refreshing);
}

}  // namespace
}  // namespace traceflow::serve
