// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/report.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;

TEST(Report, a_csv_has_a_line_for_each_row_and_quotes_where_it_must)
{
    const Json rows = Json::array({{{"name", "a,\"b\"\n"},
                                    {"inner", {{"cells", 3}, {"error", 0.1}}},
                                    {"faults", {"one", "two, three"}}},
                                   {{"name", "plain"}, {"inner", nullptr}},
                                   {{"name", ""}, {"inner", {{"error", 1e-300}}}}});
    EXPECT_EQ(csv_text({{"name", "name"},
                        {"cells", "inner/cells"},
                        {"error", "inner/error"},
                        {"faults", "faults"}},
                       rows),
              "name,cells,error,faults\n"
              "\"a,\"\"b\"\"\n\",3,0.1,\"one; two, three\"\n"
              "plain,,,\n"
              ",,1e-300,\n");
    EXPECT_EQ(csv_text({{"a", "a"}}, Json::array()), "a\n");
}

TEST(Report, data_cannot_end_the_script_that_holds_it)
{
    const std::string hostile = "</script><!--<script>\xff";
    const std::string empty = report_page(Json::object());
    const std::string page = report_page({{"name", hostile}, {"value", NAN}});
    EXPECT_TRUE(contains(
        page, ">{\"name\":\"\\u003c/script>\\u003c!--\\u003cscript>\xef\xbf\xbd\","
              "\"value\":null}<"));
    EXPECT_FALSE(contains(page, hostile));
    // All but the data is the template, whole.
    EXPECT_TRUE(empty.starts_with("<!DOCTYPE html>\n"));
    EXPECT_TRUE(empty.ends_with("</script>\n</body>\n</html>\n"));
    EXPECT_EQ(page.find("<script id="), empty.find("<script id="));
    EXPECT_FALSE(contains(empty, "REPORT"));
}

} // namespace cellwarp::core
