"""The lexer of C, and the functions that read its tokens."""

from phigen import resources
from phigen.targets.c.tokens import TokenKind, lexemes, names, tokens, without_word
from phigen.targets.c.unused import functions_of

CODE = 'f(x_1, 0x1p-3f) /* a "word" */ + "no /* comment */ 1.0" - .5e-3 * 12u;'


def test_tokens_are_the_text():
    runtime = (path.read_text(encoding="utf-8") for path in (resources.templates() / "c/runtime").glob("*.[ch]"))
    for text in (CODE, *runtime):
        assert "".join(token.text for token in tokens(text)) == text
        assert "".join(token.text for token in lexemes(text)) == text


def test_kinds_of_tokens():
    kinds = {token.text: token.kind for token in tokens(CODE)}
    assert kinds["x_1"] is kinds["f"] is TokenKind.NAME
    assert kinds["0x1p-3f"] is kinds[".5e-3"] is TokenKind.REAL
    assert kinds["12u"] is TokenKind.WHOLE
    assert kinds['/* a "word" */'] is TokenKind.COMMENT
    assert kinds['"no /* comment */ 1.0"'] is TokenKind.STRING
    assert names(CODE) == {"f", "x_1"}


def test_lexemes_are_whole_operators_and_directives():
    text = "#define A(x) x + \\\n    'c' /* 1 */\na->b <<= c+++d; f(...) # 1"
    (first, *others) = (t for t in lexemes(text) if t.kind is not TokenKind.SPACE)
    assert first.kind is TokenKind.DIRECTIVE
    assert first.text.endswith("'c' /* 1 */")
    assert " ".join(t.text for t in others) == "a -> b <<= c ++ + d ; f ( ... ) # 1"


def test_words_go_with_the_space_behind_them():
    assert without_word("double *restrict x, y[restrict 3], restricted;", "restrict") == "double *x, y[3], restricted;"


DECLARED = """\
#define N_CALL(x) n_macro(x)
typedef double n_lanes[8];
enum { n_SIZE = (2) };
static const double n_number = n_scale * (1.0);
#ifdef __cplusplus
extern "C" {
#endif
int n_exported(int (*stop)(void)); /* n_comment(); */
static inline int n_brief(void) { return n_exported(NULL); }
n_APART static
    int n_long(struct n_state *s,
        double x)
{
    if (x > 0.0) { /* } */
        return 1;
    }
    return n_brief();
}
#ifdef __cplusplus
}
#endif
static void n_last(void);"""


def test_functions_are_found_with_their_lines():
    extents = [(f.name, f.begin, f.end, f.static, f.defined) for f in functions_of(DECLARED.splitlines())]
    assert extents == [
        ("n_exported", 7, 8, False, False),
        ("n_brief", 8, 9, True, True),
        ("n_long", 9, 18, False, True),
        ("n_last", 21, 22, True, False),
    ]
