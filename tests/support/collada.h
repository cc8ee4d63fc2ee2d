// SPDX-License-Identifier: GPL-3.0-or-later
// A file of a format that is only read.
#pragma once

#include <string>

namespace cellwarp::core::support
{

/// A tetrahedron, its faces without shared corners in the file's eyes, under two nodes;
/// the second one is moved by (0, 0, 3) and twice as large.
inline std::string collada(const std::string& positions = "0 0 0 1 0 0 0 1 0 0 0 1")
{
    return R"(<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">)" +
           positions + R"(</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<vcount>3 3 3 3</vcount><p>0 2 1 0 1 3 1 2 3 0 3 2</p></polylist>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">
<node><instance_geometry url="#g"/></node>
<node><translate>0 0 3</translate><scale>2 2 2</scale><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
)";
}

} // namespace cellwarp::core::support
