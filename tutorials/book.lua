-- book.lua: what pandoc does not know of the chapters' Markdown (see book.sh)

-- links between chapters are links between pages; what is not part of the site is named without a link
function Link(link)
    local target = link.target
    if target:match('^%a+:') or target:match('^#') then return link end
    if target:match('%.md$') then
        link.target = target:gsub('README%.md$', 'index.md'):gsub('%.md$', '.html')
        return link
    end
    if target:match('%.html$') then return link end
    if target:match('^%.%./sphpa%.h$') then link.target = 'sphpa.h' return link end
    return link.content
end

-- fences: a caption where the first word alone does not tell what they are
local kinds = {output = 'prints', sh = 'commands', gnuplot = 'gnuplot', quote = 'from sphpa.h'}
function CodeBlock(block)
    local kind = block.classes[1] or ''
    local caption = kinds[kind] or ''
    if kind == 'quote' then block.classes = {'c'} end
    if kind == 'gnuplot' or kind == 'output' or kind == 'text' then block.classes = {kind, 'plain'} end
    local inside = {block}
    if caption ~= '' then inside = {pandoc.Plain(pandoc.Span(pandoc.Str(caption), {class = 'caption'})), block} end
    return pandoc.Div(inside, {class = 'fence ' .. kind})
end

-- wide tables scroll by themselves on a phone
function Table(tbl) return pandoc.Div({tbl}, {class = 'wide'}) end
