// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/scene_settings.h"

#include <cstdlib>
#include <fstream>
#include <set>
#include <type_traits>

#include <gtest/gtest.h>

#include "tests/support/files.h"

namespace cellwarp::core
{

TEST(SceneSettings, have_defaults_that_a_scene_may_state)
{
    const SceneSettings none;
    visit_settings(
        [](const SettingText& text, const auto& allowed, const auto& usual, const auto&)
        {
            SCOPED_TRACE(text.key);
            EXPECT_FALSE(usual.in_words().empty());
            if (!usual.value)
                return;
            using Allowed = std::decay_t<decltype(allowed)>;
            if constexpr (std::is_same_v<Allowed, OneOf>)
                EXPECT_TRUE(allowed.has(*usual.value));
            else if constexpr (!std::is_same_v<Allowed, YesOrNo>)
            {
                EXPECT_GE(*usual.value, allowed.low);
                EXPECT_LE(*usual.value, allowed.high);
            }
        },
        none);
}

TEST(SceneSettings, have_flags_and_labels_of_their_own)
{
    std::set<std::string> flags, labels;
    const SceneSettings none;
    visit_settings(
        [&](const SettingText& text, const auto&, const auto&, const auto&)
        {
            EXPECT_TRUE(flags.insert(text.flag()).second) << text.flag();
            EXPECT_TRUE(labels.insert(text.label).second) << text.label;
        },
        none);
    EXPECT_TRUE(flags.contains("--max-depth"));
}

TEST(SceneSettings, name_each_value_in_the_window)
{
    const SceneSettings none;
    visit_settings(
        [&](const SettingText& text, const auto& allowed, const auto&, const auto&)
        {
            if constexpr (std::is_same_v<decltype(allowed), const OneOf&>)
            {
                if (*text.section == 0) // the window has none of these
                    return;
                for (std::size_t k = 0; k < allowed.words.size(); ++k)
                    EXPECT_NE(text.names.at(k), nullptr) << text.key;
            }
        },
        none);
}

TEST(SceneSettings, get_their_defaults_where_none_is_stated)
{
    SceneSettings stated;
    stated.cells.gap = 0.5;
    const SceneSettings all = with_usual_values(stated);
    EXPECT_EQ(all.cells.gap, 0.5);
    EXPECT_EQ(all.cells.fill, "solid");
    EXPECT_EQ(all.cells.threshold, kUsualThreshold);
    EXPECT_EQ(all.cells.join, false);
    EXPECT_FALSE(all.cells.across); // the model decides
    EXPECT_FALSE(all.cells.flat);
}

/// With CELLWARP_WRITE_DOCS in the environment the table is written there.
TEST(SceneSettings, are_documented_as_they_are)
{
    const std::string begin = "<!-- settings -->\n", end = "<!-- /settings -->";
    const std::string path = support::samples_folder() + "/../docs/scenes.md";
    std::string page = support::bytes_of(path);
    const std::size_t from = page.find(begin) + begin.size(), to = page.find(end);
    ASSERT_LE(from, to);
    if (std::getenv("CELLWARP_WRITE_DOCS"))
    {
        page.replace(from, to - from, settings_table());
        std::ofstream(path) << page;
        return;
    }
    EXPECT_EQ(page.substr(from, to - from), settings_table());
}

} // namespace cellwarp::core
