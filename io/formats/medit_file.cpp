// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/medit_file.h"

#include <cmath>
#include <optional>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"

namespace cellwarp::core
{

namespace
{

constexpr double kMostCoordinate = 1e30;
constexpr std::int64_t kMostItems = 100'000'000; ///< items of a section

/// All words of a text, one after the other; comments begin with #.
class Words
{
public:
    Words(const std::string& path, std::string_view text)
        : path_(path), lines_(text, 0, true), tokens_("", 0)
    {
    }

    /// False at the end.
    bool next(std::string_view& word)
    {
        Token token;
        while (!tokens_.next(token))
        {
            std::string_view line;
            if (!lines_.next(line))
                return false;
            tokens_ = Tokens(line.substr(0, line.find('#')), 0);
        }
        word = token.text;
        return true;
    }
    double number(const std::string& field)
    {
        const std::string_view word = needed(field);
        const std::optional<double> value = parse_double(word);
        if (!value || !(std::abs(*value) <= kMostCoordinate))
            throw malformed({path_, line(), field},
                            "got " + in_quotes(word) + ", need a finite number");
        return *value;
    }
    std::int64_t whole(const std::string& field, std::int64_t low, std::int64_t high)
    {
        const std::string_view word = needed(field);
        const std::optional<std::int64_t> value = parse_integer(word);
        if (!value || *value < low || *value > high)
            throw malformed({path_, line(), field},
                            "got " + in_quotes(word) + ", need an integer from " +
                                std::to_string(low) + " to " + std::to_string(high));
        return *value;
    }
    std::int64_t line() const { return lines_.line_number(); }

private:
    std::string_view needed(const std::string& field)
    {
        std::string_view word;
        if (!next(word))
            throw malformed({path_, 0, field}, "the file ends inside it");
        return word;
    }

    const std::string& path_;
    LineReader lines_;
    Tokens tokens_;
};

class MeditReader
{
public:
    MeditReader(const std::string& path, std::string_view text)
        : path_(path), words_(path, text)
    {
    }

    MeditMesh read()
    {
        std::string_view word;
        while (words_.next(word))
        {
            const std::string name = lower_case(word);
            if (name == "end")
                break;
            if (!section(name))
                throw malformed({path_, words_.line(), std::string(word)},
                                "is no section of a Medit mesh");
        }
        check();
        return std::move(mesh_);
    }

private:
    bool section(const std::string& name)
    {
        if (name == "meshversionformatted")
            words_.whole(name, 0, 4);
        else if (name == "dimension")
            words_.whole(name, 3, 3);
        else if (name == "vertices")
            vertices();
        else if (name == "edges")
            cells(name, mesh_.edges);
        else if (name == "tetrahedra")
            cells(name, mesh_.tetrahedra);
        else if (name == "prisms" || name == "pentahedra")
            cells(name, mesh_.prisms);
        else if (name == "hexahedra" || name == "hexaedra")
            cells(name, mesh_.hexahedra);
        else if (name == "pyramids")
        {
            const std::int64_t line = words_.line();
            if (skip(name, 6) > 0)
                throw malformed({path_, line, name}, "cannot be cells of a lattice");
        }
        else if (name == "triangles" || name == "normals" || name == "tangents")
            skip(name, name == "triangles" ? 4 : 3);
        else if (name == "quadrilaterals")
            skip(name, 5);
        else if (name == "corners" || name == "ridges" || name == "requiredvertices" ||
                 name == "requirededges")
            skip(name, 1);
        else if (name == "normalatvertices" || name == "tangentatvertices")
            skip(name, 2);
        else
            return false;
        return true;
    }

    std::int64_t skip(const std::string& name, int numbers)
    {
        const std::int64_t count = words_.whole(name, 0, kMostItems);
        for (std::int64_t k = 0; k < count * numbers; ++k)
            words_.number(name);
        return count;
    }

    void vertices()
    {
        const std::int64_t count = words_.whole("vertices", 0, kMostItems);
        for (std::int64_t k = 0; k < count; ++k)
        {
            Eigen::Vector3d& x = mesh_.vertices.emplace_back();
            for (int axis = 0; axis < 3; ++axis)
                x[axis] = words_.number("vertex " + std::to_string(k + 1));
            words_.number("vertex " + std::to_string(k + 1)); // its reference
        }
    }

    template <std::size_t count>
    void cells(const std::string& name, std::vector<MeditMesh::Cell<count>>& out)
    {
        const std::int64_t all = words_.whole(name, 0, kMostItems);
        for (std::int64_t k = 0; k < all; ++k)
        {
            MeditMesh::Cell<count>& cell = out.emplace_back();
            const std::string field = name + " " + std::to_string(k + 1);
            for (int& vertex : cell.vertices)
                vertex = static_cast<int>(words_.whole(field, 1, kMostItems)) - 1;
            cell.reference = words_.whole(field, -kMostItems, kMostItems);
            cell.line = words_.line();
        }
    }

    template <std::size_t count>
    void check(const char* name, const std::vector<MeditMesh::Cell<count>>& cells) const
    {
        for (const MeditMesh::Cell<count>& cell : cells)
            for (const int vertex : cell.vertices)
                if (vertex >= static_cast<int>(mesh_.vertices.size()))
                    throw malformed({path_, cell.line, name},
                                    "vertex " + std::to_string(vertex + 1) +
                                        " is not there (there are " +
                                        std::to_string(mesh_.vertices.size()) + ")");
    }

    void check() const
    {
        check("Edges", mesh_.edges);
        check("Tetrahedra", mesh_.tetrahedra);
        check("Prisms", mesh_.prisms);
        check("Hexahedra", mesh_.hexahedra);
        if (mesh_.tetrahedra.empty() && mesh_.prisms.empty() && mesh_.hexahedra.empty())
            throw malformed({path_, 0, ""},
                            "has no hexahedra, tetrahedra or prisms: no lattice");
    }

    const std::string& path_;
    Words words_;
    MeditMesh mesh_;
};

} // namespace

MeditMesh read_medit(const std::string& path)
{
    return parse_medit(path, read_file(path));
}

MeditMesh parse_medit(const std::string& path, std::string_view text)
{
    if (const std::string guess = foreign_content(text); !guess.empty())
        throw malformed({path, 0, ""}, "is " + guess + ", need a Medit mesh");
    return MeditReader(path, text).read();
}

} // namespace cellwarp::core
