from vftcli.outputs.believability import Ground
from vftcli.outputs.page.believability_part import believability_section, capital


def test_a_ground_is_shown_with_its_sign_and_its_remedy() -> None:
    good = Ground(standing="good", subject="clock", sentence="no gap <b>")
    bad = Ground(standing="bad", subject="load", sentence="heavy", remedy="vftcli x '<i>'")
    html = believability_section([bad, good])
    assert html.index("Load") < html.index("Clock")
    assert '<b class="sign bad">✗</b>' in html
    assert '<code class="remedy">vftcli x &#x27;&lt;i&gt;&#x27;</code>' in html
    assert "no gap &lt;b&gt;" in html
    assert html.count('class="remedy"') == 1


def test_a_capital_is_the_first_letter_alone() -> None:
    assert (capital("the arm is still"), capital("")) == ("The arm is still", "")
