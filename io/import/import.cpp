// SPDX-License-Identifier: GPL-3.0-or-later
// The library runs in a program of its own, see main.cpp: of it only the list of formats
// is asked for here.
#include "io/import/import.h"

#include <string>
#include <system_error>

#include <unistd.h>

#include <assimp/Importer.hpp>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/import/imported.h"
#include "octree/base/helper.h"

namespace cellwarp::core
{

namespace
{

/// End of the importer's run on the file.
HelperEnd importer_end(const std::string& path, const std::string& bytes)
{
    try
    {
        return run_helper("cellwarp-import",
                          {extension_of(path), std::to_string(::getpid())}, bytes);
    }
    catch (const std::system_error& error)
    {
        throw Error(Fault::File, at({path, 0, ""}, error.what()));
    }
}

} // namespace

bool is_import_format(std::string_view extension)
{
    return !extension.empty() &&
           Assimp::Importer().IsExtensionSupported("." + std::string(extension));
}

Geometry import_geometry(const std::string& path, const std::string& bytes)
{
    if (bytes.empty())
        throw malformed({path, 0, ""}, "the file is empty: no vertices");
    const HelperEnd end = importer_end(path, bytes);
    if (end.code != 0)
        throw malformed({path, 0, ""},
                        "cannot be imported: the importer " +
                            (end.signal != 0
                                 ? "ended with signal " + std::to_string(end.signal)
                                 : std::string("gave up")));
    Imported found;
    if (!parse_imported(end.out, found))
        throw malformed({path, 0, ""}, "cannot be imported: the importer ended early");
    if (!found.problem.empty())
        throw malformed({path, 0, ""}, found.problem);
    Geometry out;
    out.format = extension_of(path);
    out.samples = std::move(found.samples);
    out.directions = std::move(found.directions);
    out.direction_samples = std::move(found.direction_samples);
    out.corners = std::move(found.corners);
    out.face_ends.append(found.face_ends.begin(), found.face_ends.end());
    if (!out.directions.empty())
        out.attributes.push_back("normals");
    out.not_writable = "a ." + out.format + " can only be read";
    out.warnings.push_back(
        at({path, 0, ""}, "imported: coordinates are 32-bit floats, vertices may be "
                          "split and reordered, and only samples, faces and normals are "
                          "kept"));
    return out;
}

} // namespace cellwarp::core
