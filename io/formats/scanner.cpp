// SPDX-License-Identifier: GPL-3.0-or-later
// Which scanner reads which format.
#include "io/formats/scanner.h"

#include <utility>

#include "io/base/error.h"
#include "io/base/text.h"
#include "io/formats/columns.h"
#include "io/formats/obj.h"
#include "io/formats/off.h"
#include "io/formats/pcd.h"
#include "io/formats/ply.h"
#include "io/formats/stl.h"

namespace cellwarp::core
{

namespace
{

template <class Format>
class ScannerOf : public Scanner
{
public:
    explicit ScannerOf(Format format) : format_(std::move(format)) {}

    std::size_t scan(std::string_view part, std::uint64_t start, bool is_last,
                     Geometry& out) override
    {
        return format_.scan(part, start, is_last, out);
    }
    std::size_t skip([[maybe_unused]] std::string_view part) override
    {
        if constexpr (requires { format_.skip(part); })
            return format_.skip(part);
        return 0;
    }
    void finish(Geometry& out) override { format_.finish(out); }
    std::unique_ptr<Scanner> copy() const override
    {
        return std::make_unique<ScannerOf>(*this);
    }

private:
    Format format_;
};

template <class Format>
std::unique_ptr<Scanner> as_scanner(Format format)
{
    return std::make_unique<ScannerOf<Format>>(std::move(format));
}

} // namespace

std::unique_ptr<Scanner> make_scanner(const std::string& path, const std::string& format,
                                      std::uint64_t file_bytes,
                                      const ReadOptions& options)
{
    if (format == "obj")
        return as_scanner(ObjScanner(path));
    if (format == "ply")
        return as_scanner(PlyScanner(path, file_bytes));
    if (format == "stl")
        return as_scanner(StlScanner(path, file_bytes));
    if (format == "off")
        return as_scanner(OffScanner(path, file_bytes));
    if (format == "pcd")
        return as_scanner(PcdScanner(path, file_bytes));
    return as_scanner(ColumnsScanner(path, format, options.columns));
}

void check_content(const std::string& path, const std::string& format,
                   std::string_view part, std::uint64_t start, bool is_last)
{
    if (start == 0 && part.empty())
        throw malformed({path, 0, ""}, "the file is empty: no vertices");
    const bool may_be_binary =
        format == "stl" || format == "pcd" || format == "glb" ||
        (format == "ply" && (start > 0 || part.starts_with("ply")));
    if (may_be_binary)
        return;
    if (is_last)
        part = without_end_mark(part, start);
    if (const std::string guess =
            start == 0 ? foreign_content(part) : foreign_bytes(part);
        !guess.empty())
        throw malformed({path, 0, ""}, "this looks like " + guess + ", need " + format);
}

} // namespace cellwarp::core
