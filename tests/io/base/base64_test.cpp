// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/base64.h"

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(Base64, decodes_and_encodes_what_its_standard_gives)
{
    const std::pair<const char*, const char*> pairs[] = {{"", ""},
                                                         {"Zg==", "f"},
                                                         {"Zm8=", "fo"},
                                                         {"Zm9v", "foo"},
                                                         {"Zm9vYg==", "foob"},
                                                         {"Zm9vYmE=", "fooba"},
                                                         {"Zm9vYmE", "fooba"},
                                                         {"Zm9vYmFy", "foobar"},
                                                         {"+/+/", "\xfb\xff\xbf"}};
    for (const auto& [text, bytes] : pairs)
    {
        EXPECT_EQ(base64_decoded(text), bytes) << text;
        if (std::string_view(text).size() % 4 == 0)
        {
            EXPECT_EQ(base64_encoded(bytes), text);
        }
    }
    for (const char* text :
         {"Z", "Zm9vY", "Zm=v", "Zm9 ", "Zm9v====", "Zm-v", "=", "Z==="})
        EXPECT_FALSE(base64_decoded(text)) << text;
}

TEST(Base64, a_patch_changes_the_characters_of_what_changed)
{
    // The last character of "Zn" holds bits of no byte: they stay where nothing changes.
    EXPECT_EQ(base64_patched("Zm9vYmFyZn", "foobarf", "foocarf"), "Zm9vY2FyZn");
    EXPECT_EQ(base64_patched("Zm9vYmFyZg==", "foobarf", "foobarg"), "Zm9vYmFyZw==");
    EXPECT_EQ(base64_decoded(base64_patched("Zm9vYmE=", "fooba", "\xff\xfe\x01xy")),
              "\xff\xfe\x01xy");
}

} // namespace cellwarp::core
