// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/fields.h"

#include "io/formats/geometry_file.h"
#include "library/session/session.h"
#include "tests/support/shapes.h"

namespace cellwarp::core::support
{

std::string twisted_bar_field(FieldKind kind)
{
    SessionSettings settings;
    settings.cells.across = 12;
    settings.field = kind;
    settings.keeps_fields = true;
    Session session(
        scan_geometry("bar.obj", obj_text(box_shape({0, 0, 0}, {6, 2, 2}, 6))).geometry,
        parse_handles("bar.handles", "cellwarp-handles 1\n"
                                     "fixed foot box -1 -1 -1 0.6 3 3\n"
                                     "handle head box 5.4 -1 -1 7 3 3\n"
                                     "frame 1\n"
                                     "move head rotate 1 0 0 60 about 6 1 1\n"),
        settings);
    while (session.next_frame(true))
        ;
    return field_bytes(session.field_file());
}

} // namespace cellwarp::core::support
